"""Files of results: whole or not there; nothing in them commands a terminal or a parser."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

import rigtwin
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, printable
from rigtwin.recording import Writer, load
from rigtwin.recording.export import export
from rigtwin.recording.schema import END_RECORD
from rigtwin.render.plot import _part, draw
from rigtwin.studies.sweep.cluster import Cluster
from tests.helpers.described import NOISY, described


def recording_of(path: Path, values: np.ndarray, names: list[str], machine: str = "bench"):
    """Of sensors; values: shape (ticks, sensors)."""
    with Writer(path, machine, 1e-3, {}, machine, {"/sensor": names}) as writer:
        writer.append(sensor=values)
    return load(path)


def test_a_file_that_cannot_be_finished_stays_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "a.html"
    atomic_write(path, "before")

    def full(_: Path, __: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(RigtwinError, match=r"cannot write .*a\.html: No space left on device"):
        atomic_write(path, "after")
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_links_and_devices_stay_what_they_are(tmp_path):
    link, path = tmp_path / "link", tmp_path / "file"
    link.symlink_to(path)
    atomic_write(link, "through")
    assert link.is_symlink()
    assert path.read_text() == "through"
    atomic_write(Path(os.devnull), "nowhere")
    assert not Path(os.devnull).is_file()
    atomic_write(path, "name \udcff")
    assert path.read_text() == "name ?"


def test_what_a_recording_says_of_itself_commands_no_terminal(tmp_path, capsys):
    path = tmp_path / "e.mcap"
    with Writer(path, "\x1b[31mred\n\x07", 1e-3, {"\x1bkey": "\x1b"}, "\x1b[2J") as writer:
        writer.append(sensor=np.arange(1200.0).reshape(300, 4))
        writer.add_metadata(END_RECORD, {"reason": "\x9b31m"})
        writer.finish("\x1b[0m")
    assert main(["info", str(path)]) == 0
    assert printable(capsys.readouterr().out.replace("\n", "")).count("\x1b") == 0
    assert load(path).machine == "?[2J"
    assert main(["info", str(tmp_path / "\x1b[31m.mcap")]) == 1
    assert "\x1b" not in capsys.readouterr().err


def test_names_that_matlab_does_not_take_are_said(tmp_path):
    long, values = "x" * 40, np.arange(600.0).reshape(300, 2)
    good = recording_of(tmp_path / "g.mcap", values, [long, "ok"])
    export(good, tmp_path / "g.mat")
    assert np.array_equal(
        loadmat(tmp_path / "g.mat", simplify_cells=True)["sensor"][long], values[:, 0]
    )
    for name in ("_lead", "x" * 56):
        bad = recording_of(tmp_path / "b.mcap", values, [name, "ok"])
        with pytest.raises(RigtwinError, match="cannot be a field in MATLAB"):
            export(bad, tmp_path / "b.mat")
    assert not (tmp_path / "b.mat").exists()


def test_a_header_with_commas_is_quoted(tmp_path):
    recording = recording_of(tmp_path / "g.mcap", np.ones((300, 1)), ["a"])
    odd = replace(recording, columns={"/sensor": {"a,b": np.ones(300)}})
    export(odd, tmp_path / "g.csv")
    assert (tmp_path / "g.csv").read_text().splitlines()[0] == 'time,"sensor.a,b"'


@pytest.mark.slow
def test_pictures_of_odd_recordings(tmp_path):
    values = np.array([[1e308], [-1e308]] * 150)
    with pytest.raises(RigtwinError, match=r"a goes beyond 1e\+100, which cannot be drawn"):
        draw(recording_of(tmp_path / "h.mcap", values, ["a"]), tmp_path / "h.png")
    tex = recording_of(tmp_path / "$\\frac{$.mcap", np.ones((300, 1)), ["a"], "$\\frac{$")
    draw(tex, tmp_path / "t.svg")
    line, gap = np.arange(5.0), np.array([0.0, 1.0, 2.0, 7.0, 8.0])
    assert np.isnan(_part(gap, line, 1.0)[1]).tolist() == [False] * 3 + [True] + [False] * 2
    assert _part(line, line, 1.0)[0].tolist() == line.tolist()
    wide = recording_of(tmp_path / "m.mcap", np.ones((300, 25)), [f"c{n}" for n in range(25)])
    draw(wide, tmp_path / "m.svg")
    assert (tmp_path / "m.svg").stat().st_size > 0


@pytest.mark.parametrize("address", ["nonsense", "tcp://", "tcp://127.0.0.1:1", "a:99999999999"])
def test_a_cluster_that_is_not_there_is_one_line(address):
    with pytest.raises(RigtwinError, match="expected a scheduler's address"):
        Cluster(address)


def test_streams_that_are_closed_stop_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    path = recording_of(tmp_path / "g.mcap", np.ones((300, 1)), ["a"]).path
    assert main(["info", str(path)]) == 0
    assert main(["info", str(tmp_path / "absent.mcap")]) == 1

    class Closed:
        def write(self, _: str) -> int:
            raise BrokenPipeError

        def flush(self) -> None: ...

        def fileno(self) -> int:
            raise OSError

    monkeypatch.setattr(sys, "stdout", Closed())
    assert main(["--version"]) == 1


def test_nothing_that_was_made_overwrites_what_it_was_made_of(tmp_path):
    described(tmp_path, "slide", NOISY)
    machine = rigtwin.machine(tmp_path / "bench.toml")
    short = {"timing": {"duration": 2.0}}
    made = rigtwin.run(machine, "shake", settings=short, path=tmp_path / "one.mcap")
    answer = rigtwin.diagnose(made)
    inputs = [tmp_path / "one.mcap", *machine.files]
    assert [path.suffix for path in inputs] == [".mcap", ".toml", ".xml"]
    before = [path.read_bytes() for path in inputs]
    writers = [answer.report, answer.save_twin, answer.save_mjcf]
    writers += [lambda path: rigtwin.look(made).save(path, {})]
    writers += [lambda path: made.export(path), lambda path: made.plot(path)]
    for path in inputs:
        for write in writers[:4]:
            with pytest.raises(RigtwinError, match="is the input; name another output"):
                write(path)
    for write in writers[4:]:
        with pytest.raises(RigtwinError, match="is the input; name another output"):
            write(inputs[0])
    for path in machine.files:
        with pytest.raises(RigtwinError, match="is the input; name another output"):
            rigtwin.run(machine, "shake", settings=short, path=path)
    assert [path.read_bytes() for path in inputs] == before


def test_a_command_does_not_overwrite_a_model_or_what_it_includes(tmp_path, capsys):
    described(tmp_path, "slide", NOISY)
    model = tmp_path / "bench.xml"
    whole = model.read_text()
    (tmp_path / "extra.xml").write_text("<mujoco><worldbody><site/></worldbody></mujoco>")
    model.write_text(whole.replace("<worldbody>", '<include file="extra.xml"/><worldbody>', 1))
    toml = tmp_path / "bench.toml"
    for out in ("bench.xml", "extra.xml", "bench.toml"):
        before = (tmp_path / out).read_bytes()
        arguments = ["run", "shake", "--machine", str(toml), "--out", str(tmp_path / out)]
        assert main(arguments) == 1
        assert "is the input; name another output" in capsys.readouterr().err
        assert (tmp_path / out).read_bytes() == before


def test_what_an_mjcf_includes_must_be_a_file(tmp_path):
    described(tmp_path, "slide", NOISY)
    model = tmp_path / "bench.xml"
    text = model.read_text()
    model.write_text(text.replace("<worldbody>", '<include file="/dev/zero"/><worldbody>', 1))
    with pytest.raises(RigtwinError, match="it includes /dev/zero; expected a file"):
        rigtwin.machine(tmp_path / "bench.toml")


@pytest.mark.parametrize("out", ["/dev/null", "{folder}/pipe"])
def test_a_recording_needs_a_file_before_the_test_runs(tmp_path, capsys, monkeypatch, out):
    """It is read again when it is whole, which neither a device nor a pipe can be."""
    os.mkfifo(tmp_path / "pipe")
    path = out.format(folder=tmp_path)
    monkeypatch.setattr("rigtwin.rig.physics.SuspensionRig.record", pytest.fail)
    assert main(["run", "drop", "--out", path]) == 1
    said = capsys.readouterr().err
    assert said == f"rigtwin: cannot record to {path}: it is no file but a device or a pipe\n"


@pytest.mark.slow
def test_an_import_onto_a_full_disk_leaves_nothing_that_is_cut(tmp_path):
    rows = "\n".join(f"{0.001 * n:.3f},{(n * 7919) % 1000 / 997:.9f}" for n in range(30_000))
    (tmp_path / "log.csv").write_text(f"t,x\n{rows}\n")
    (tmp_path / "map.toml").write_text(
        'machine = "emps"\ntime = { column = "t" }\n'
        '[channels]\n"/sensor.position" = { column = "x" }\n'
    )
    out = tmp_path / "log.mcap"
    out.write_bytes(b"before")
    program = (
        "import resource, sys; from rigtwin.cli import main; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)); "
        "sys.exit(main(['import', 'log.csv', '--map', 'map.toml', '-o', 'log.mcap']))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1
    assert "cannot write log.mcap" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert out.read_bytes() == b"before"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["log.csv", "log.mcap", "map.toml"]
