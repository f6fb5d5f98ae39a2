"""The command line as a user meets it: what it prints, its exit codes, and one line for every
fault."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from experiments import EXPERIMENTS
from rigtwin.cli import main
from rigtwin.recording import load
from tests.helpers.recordings import SHIPPED

RIG = SHIPPED["known-coulomb-motor"]
QUICK = ["--set", "timing.duration=0.5"]


def test_run_info_compare_export_plot(tmp_path, capsys):
    path = tmp_path / "d.mcap"
    assert (
        main(
            [
                "run",
                "drop",
                "--out",
                str(path),
                "--seed",
                "3",
                "--set",
                "timing.duration=1",
                "--set",
                "rail.coulomb=60",
            ]
        )
        == 0
    )
    assert "1.000 s recorded" in capsys.readouterr().out
    recording = load(path)
    assert (recording.ticks, recording.twin["seed"]) == (1000, "3")
    assert json.loads(recording.twin["parameters"])["rail"]["coulomb"] == 60.0
    assert main(["info", str(path)]) == 0
    assert "/sensor.load_cell" in capsys.readouterr().out
    assert (
        main(["compare", str(path), "--json", str(tmp_path / "j.json"), "--set", "rail.coulomb=60"])
        == 0
    )
    replays = json.loads((tmp_path / "j.json").read_text())["replays"]
    for name in (
        "motor",
        "carriage",
        "mechanics",
        "structure_cylinder",
        "ground_cylinder",
        "controller",
    ):
        assert {"residual", "noise_floor", "ratio"} <= set(replays[name])
    assert main(["export", str(path), "-o", str(tmp_path / "d.csv")]) == 0
    assert main(["plot", str(path)]) == 0
    assert (tmp_path / "d.png").exists()
    assert main(["compare", str(path), str(path)]) == 0


def test_list(capsys):
    assert main(["list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in EXPERIMENTS)
    assert main(["list", "--settings", "drop"]) == 0
    assert "rail.coulomb" in capsys.readouterr().out


def test_a_trip_is_said_and_has_its_exit_code(tmp_path, capsys):
    path = tmp_path / "t.mcap"
    assert main(["run", "motorcycle", "--out", str(path)]) == 3
    assert "trip: structure_lvdt is more than 0.06 m off its command" in capsys.readouterr().out
    assert load(path).end.startswith("trip")


def bad(tmp_path: Path) -> dict[str, tuple[list[str], str]]:
    toml, text, empty = tmp_path / "bad.toml", tmp_path / "text.mcap", tmp_path / "empty.mcap"
    toml.write_text("[rail")
    text.write_text("not a recording")
    empty.write_bytes(b"")
    out = ["--out", str(tmp_path / "o.mcap")]
    return {
        "experiment": (["run", "dorp", *out], "unknown experiment 'dorp'; there are drop"),
        "toml": (["run", "drop", "--config", str(toml), *out], "not valid TOML"),
        "nan": (["run", "drop", "--set", "carriage.mass=nan", *out], "carriage.mass = nan"),
        "period": (["run", "drop", "--set", "timing.timestep=0.0003", *out], "whole multiple"),
        "step above period": (
            ["run", "drop", "--set", "timing.timestep=0.002", *out],
            "whole multiple",
        ),
        "seed": (["run", "drop", "--seed", "-1", *out], "--seed -1"),
        "road": (["run", "road10", "--set", "road.lowest=20", *out], "road.highest"),
        "out": (
            ["run", "drop", "--out", str(tmp_path / "absent" / "o.mcap"), *QUICK],
            "cannot write",
        ),
        "empty": (["compare", str(empty)], "is empty"),
        "foreign": (["info", str(text)], "is not an MCAP file"),
        "absent": (["plot", str(tmp_path / "absent.mcap")], "cannot read"),
        "folder": (["video", str(tmp_path)], "cannot read"),
        "ending": (["export", str(RIG), "-o", str(tmp_path / "e.xyz")], ".csv or .mat"),
        "json": (
            ["compare", str(RIG), "--json", str(tmp_path / "absent" / "j.json")],
            "cannot write",
        ),
        "two and set": (["compare", str(RIG), str(RIG), "--set", "rail.coulomb=3"], "without one"),
        "study": (["reproduce", "table-9.9"], "there are chapters 3, 4, 5, 6, 7, A, B"),
        "seeds": (["reproduce", "table-3.5", "--seeds", "0"], "--seeds 0"),
        "workers": (["reproduce", "table-3.5", "--workers", "0"], "workers 0"),
        "nothing to compute": (["reproduce", "table-2.1"], "nothing of it is of the rig"),
        "map": (["stability", "--map", "tau", "tau"], "two different parameters"),
        "page": (
            ["reproduce", "table-3.5", "--html", str(tmp_path / "absent" / "p.html")],
            "cannot write",
        ),
        "vehicle": (["stability", "--vehicle", "bicycle"], "there are"),
        "calibrate": (["calibrate", str(empty)], "is empty"),
    }


@pytest.mark.parametrize("case", bad(Path("/tmp")))
def test_bad_input_gives_one_clear_line(tmp_path, capsys, case):
    arguments, says = bad(tmp_path)[case]
    before = set(tmp_path.iterdir())
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("rigtwin: ")
    assert error.count("\n") == 1
    assert says in error
    assert set(tmp_path.iterdir()) == before, "nothing is half-written"


def test_no_command_is_usage(capsys):
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2
    assert "command" in capsys.readouterr().err


def test_default_name_never_overwrites(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for _ in range(3):
        assert main(["run", "drop", *QUICK]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "drop-0-2.mcap",
        "drop-0-3.mcap",
        "drop-0.mcap",
    ]


def test_ctrl_c_leaves_a_readable_recording_and_one_line(tmp_path):
    path = tmp_path / "c.mcap"
    command = [
        sys.executable,
        "-m",
        "rigtwin",
        "run",
        "drop",
        "--out",
        str(path),
        "--set",
        "timing.duration=3600",
    ]
    # A shell's background job may have handed down an ignored Ctrl-C; a user's terminal does not.
    restored = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, restored)
    deadline = time.monotonic() + 60
    while (not path.exists() or path.stat().st_size < 100_000) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130, error
    assert error.strip() == "rigtwin: interrupted"
    recording = load(path)
    assert recording.end == "interrupted: KeyboardInterrupt"
    assert recording.notes == ()


def test_progress_is_shown_on_a_terminal_only(tmp_path, capsys):
    run = ["run", "drop", "--out", str(tmp_path / "p.mcap"), *QUICK]
    assert main(run) == 0
    assert capsys.readouterr().err == ""
    command = [sys.executable, "-m", "rigtwin", *run]
    controller, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    subprocess.run(command, stderr=terminal, stdout=subprocess.DEVNULL, check=True)
    assert select.select([controller], [], [], 5)[0], "nothing was shown"
    assert b"drop:" in os.read(controller, 65536)
    os.close(terminal)
    os.close(controller)


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom rigtwin.cli import main\n"
        "try: main(['--help'])\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'mujoco', 'numba', 'scipy', 'matplotlib'} "
        "& set(sys.modules)\nassert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "a first session" in done.stdout


@pytest.mark.parametrize("command", ["plot", "export", "video", "compare"])
def test_no_command_overwrites_its_input(tmp_path, capsys, command):
    ending = {"plot": "png", "export": "csv", "video": "mp4", "compare": "json"}[command]
    path = tmp_path / f"in.{ending}"
    path.write_bytes(RIG.read_bytes())
    flag = "--json" if command == "compare" else "-o"
    assert main([command, str(path), flag, str(path)]) == 1
    assert "is the input" in capsys.readouterr().err
    assert path.read_bytes() == RIG.read_bytes()


@pytest.mark.parametrize(
    "ignored", ["controller.kp=5", "timing.duration=1", "safety.force=100", "road.speed=3"]
)
def test_compare_refuses_settings_that_it_would_ignore(capsys, ignored):
    assert main(["compare", str(RIG), "--set", ignored]) == 1
    assert "the recording's" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "drop", "--config", "{file}", "--out", "{file}"], "is the input"),
        (["run", "drop", "--machine", "{file}", "--out", "{file}"], "is the input"),
        (["diagnose", "a.mcap", "--config", "{file}", "--html", "{file}"], "is the input"),
        (["compare", "a.mcap", "--machine", "{file}", "--json", "{file}"], "is the input"),
        (["tune", "{file}", "--out", "{file}"], "is the input"),
        (["diagnose", "a.mcap", "--json", "b", "--html", "./b"], "one would be lost"),
    ],
)
def test_no_output_is_an_input_or_another_output(arguments, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "settings.toml"
    file.write_text("[rail]\ncoulomb = 80\n")
    assert main([text.format(file=file) for text in arguments]) == 1
    assert said in capsys.readouterr().err
    assert file.read_text() == "[rail]\ncoulomb = 80\n"


def test_info_has_the_units_of_hinges(tmp_path, capsys):
    path = str(tmp_path / "swing.mcap")
    run = ["run", "swing", "--machine", "double-pendulum", "--set", "timing.duration=2"]
    assert main([*run, "--out", path]) == 0
    capsys.readouterr()
    assert main(["info", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines if "angle_" in line] == ["rad", "rad"]
    assert [line.split()[1] for line in lines if "torque_" in line] == ["Nm", "Nm"]


def test_the_package_runs_as_a_module():
    answer = subprocess.run(
        [sys.executable, "-m", "rigtwin", "--version"], capture_output=True, text=True, check=True
    )
    assert answer.stdout.startswith("rigtwin ")
