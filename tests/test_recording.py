"""Recordings: written and read alike, readable by others, whole or in part; never a traceback for a
bad file."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as OtherWriter
from mcap_protobuf.decoder import DecoderFactory
from scipy.io import loadmat

from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.recording import Writer, load
from rigtwin.recording.channels import CHANNELS, topic_fields
from rigtwin.recording.export import export
from tests.helpers.recordings import EXAMPLE, SHIPPED, shipped

CONTROLLER = {"mode": "mil", "kp": 0.3}


def values(ticks: int, seed: int = 0) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {name: random.standard_normal((ticks, 4)) for name in ("command", "sensor", "truth")}


def written(path, ticks: int = 1000, block: int = 250) -> dict[str, np.ndarray]:
    data = values(ticks)
    with Writer(path, "test", 1e-3, CONTROLLER) as writer:
        for first in range(0, ticks, block):
            writer.append(**{name: column[first : first + block] for name, column in data.items()})
    return data


def test_every_channel_comes_back_exactly(tmp_path):
    data = written(tmp_path / "r.mcap")
    recording = load(tmp_path / "r.mcap")
    for channel in CHANNELS:
        column = data[channel.topic[1:]][:, topic_fields(channel.topic).index(channel.name)]
        assert np.array_equal(recording.column(channel.topic, channel.name), column), channel
    assert (recording.machine, recording.experiment, recording.period) == (
        "suspension-rig",
        "test",
        1e-3,
    )
    assert recording.controller == CONTROLLER
    assert (recording.end, recording.notes, recording.ticks) == ("completed", (), 1000)
    assert np.array_equal(np.round(recording.time * 1e9), np.arange(1000) * 1e6)


def test_other_readers_read_it(tmp_path):
    data = written(tmp_path / "r.mcap")
    with (tmp_path / "r.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 3000
        values = [
            message.load_cell
            for _, channel, _, message in reader.iter_decoded_messages(topics=["/sensor"])
            if channel
        ]
        assert np.array_equal(values, data["sensor"][:, 3])
        late = [
            message.log_time
            for _, _, message in reader.iter_messages(topics=["/command"], starting_at=900_000_000)
        ]
        assert late == [int(tick * 1e6) for tick in range(900, 1000)]
        assert [record.name for record in reader.iter_metadata()] == ["rigtwin", "rigtwin.end"]


@pytest.mark.parametrize("omit", [None, "load_cell"])
def test_json_and_other_protobuf_writers_are_read(tmp_path, omit):
    """Messages as another program writes them: JSON, extra fields and topics, a field that the rig
    does not have."""
    path = tmp_path / "o.mcap"
    data = values(300)
    fields = [name for name in topic_fields("/sensor") if name != omit]
    with path.open("wb") as file:
        writer = OtherWriter(file)
        writer.start()
        schema = writer.register_schema("sensor", "jsonschema", b"{}")
        sensor = writer.register_channel("/sensor", "json", schema)
        weather = writer.register_channel("/weather", "json", schema)
        config = json.dumps({"controller": CONTROLLER})
        about = {
            "format": "1",
            "machine": "suspension-rig",
            "experiment": "x",
            "period": "0.001",
            "config": config,
        }
        writer.add_metadata("rigtwin", about)
        for tick in range(300):
            row = {
                name: data["sensor"][tick, topic_fields("/sensor").index(name)] for name in fields
            }
            writer.add_message(
                sensor, tick * 1_000_000, json.dumps({**row, "extra": 1}).encode(), tick * 1_000_000
            )
            writer.add_message(weather, tick * 1_000_000, b"{}", tick * 1_000_000)
        writer.finish()
    recording = load(path)
    assert list(recording.columns["/sensor"]) == [*fields, "extra"], (
        "the table's first, then what else there is"
    )
    assert np.allclose(
        recording.column("/sensor", "ground_lvdt"), data["sensor"][:, 0], rtol=0, atol=0
    )
    if omit:
        with pytest.raises(
            RigtwinError, match=f"channel /sensor.{omit} is missing; it has /sensor.ground_lvdt"
        ):
            recording.column("/sensor", omit)


@pytest.mark.parametrize("name", SHIPPED)
def test_recordings_that_come_with_the_project(name):
    recording = shipped(name)
    ticks = 20_000 if name == EXAMPLE.stem else 8_000
    assert (recording.ticks, recording.period, recording.notes) == (ticks, 1e-3, ())


@pytest.mark.parametrize("share", [0.3, 0.5, 0.77, 0.9, 0.999])
def test_a_truncated_recording_is_read_up_to_its_last_chunk(tmp_path, share):
    data = written(tmp_path / "r.mcap", ticks=5000)
    whole = (tmp_path / "r.mcap").read_bytes()
    (tmp_path / "t.mcap").write_bytes(whole[: int(share * len(whole))])
    recording = load(tmp_path / "t.mcap")
    assert recording.ticks >= share * 5000 - 500
    assert "cut off" in recording.notes[0]
    assert f"{recording.time[-1]:.3f} s" in recording.notes[0]
    assert np.array_equal(
        recording.column("/sensor", "load_cell"), data["sensor"][: recording.ticks, 3]
    )


def test_no_damage_gives_anything_but_an_error_or_a_note(tmp_path):
    """Bytes flipped, cut and repeated at random."""
    written(tmp_path / "r.mcap", ticks=600)
    whole = (tmp_path / "r.mcap").read_bytes()
    random = np.random.default_rng(1)
    for _ in range(150):
        data = bytearray(whole[: random.integers(1, len(whole) + 1)])
        for place in random.integers(0, len(data), random.integers(0, 4)):
            data[place] = random.integers(0, 256)
        (tmp_path / "d.mcap").write_bytes(bytes(data))
        message, ticks = "", 1
        try:
            ticks = load(tmp_path / "d.mcap").ticks
        except RigtwinError as error:
            message = str(error)
        assert ticks > 0
        assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"hello, this is a text", "is not an MCAP file"),
        (b"\x89MCAP0\r\n", "is not a"),
        (b"\x00" * 400, "is not an MCAP file"),
    ],
)
def test_foreign_files_are_refused_in_one_line(tmp_path, content, says):
    path = tmp_path / "f.mcap"
    path.write_bytes(content)
    with pytest.raises(RigtwinError, match=says) as error:
        load(path)
    assert str(path) in str(error.value)


def test_a_model_among_the_recordings_is_recognised(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text("<mujoco/>")
    with pytest.raises(RigtwinError, match="is given as --machine"):
        load(path)


def test_mcap_of_something_else_is_refused(tmp_path):
    path = tmp_path / "f.mcap"
    with path.open("wb") as file:
        writer = OtherWriter(file)
        writer.start()
        writer.finish()
    with pytest.raises(RigtwinError, match="not a rig recording"):
        load(path)
    with pytest.raises(RigtwinError, match="cannot read"):
        load(tmp_path / "absent.mcap")
    with pytest.raises(RigtwinError, match="cannot read"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"period": "fast"}, "period 'fast'"),
        ({"period": "-1"}, "period '-1'"),
        ({"format": "2"}, "format '2'"),
        ({"config": "{"}, "config"),
        ({"config": "[]"}, "config"),
    ],
)
def test_metadata_that_makes_no_sense_is_refused(tmp_path, change, says):
    path = tmp_path / "m.mcap"
    with path.open("wb") as file:
        writer = OtherWriter(file)
        writer.start()
        writer.add_metadata("rigtwin", {"format": "1", "period": "0.001", "config": "{}", **change})
        writer.finish()
    with pytest.raises(RigtwinError, match=says):
        load(path)


KILLED = """
import sys, time
import numpy as np
from pathlib import Path
from rigtwin.recording import Writer
from rigtwin.simulation.loop import BLOCK
with Writer(Path(sys.argv[1]), "killed", 1e-3, {}) as writer:
    tick = 0
    block = []
    while True:
        block.append([tick] * 4)
        tick += 1
        if len(block) == BLOCK:
            writer.append(command=np.array(block, float), sensor=np.array(block, float))
            block = []
        if tick % 10 == 0:
            print(tick, flush=True)
            time.sleep(0.002)
"""


def test_kill_9_loses_at_most_half_a_second(tmp_path):
    path = tmp_path / "k.mcap"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    reached = 0
    while reached < 3170:
        reached = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    reached = max([reached, *(int(line) for line in process.stdout.read().split())])
    process.wait()
    recording = load(path)
    assert reached - recording.ticks <= 500
    assert np.array_equal(recording.column("/sensor", "load_cell"), np.arange(recording.ticks))
    assert "cut off" in recording.notes[0]


@pytest.mark.slow
def test_kill_9_while_the_twin_runs(tmp_path):
    path = tmp_path / "k.mcap"
    command = [
        sys.executable,
        "-m",
        "rigtwin",
        "run",
        "road10",
        "--out",
        str(path),
        "--set",
        "timing.duration=120",
    ]
    process = subprocess.Popen(command)
    deadline = time.monotonic() + 300
    while (not path.exists() or path.stat().st_size < 300_000) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    recording = load(path)
    assert recording.ticks > 250
    assert recording.ticks % 250 == 0


def test_export_csv_and_mat(tmp_path):
    data = written(tmp_path / "r.mcap", ticks=20)
    recording = load(tmp_path / "r.mcap")
    export(recording, tmp_path / "r.csv")
    rows = list(csv.reader(io.StringIO((tmp_path / "r.csv").read_text())))
    assert rows[0][:3] == ["time", "command.ground", "command.structure"]
    assert rows[1][:5] == ["s", "m", "m", "N", "V"]
    assert np.allclose(np.array(rows[2:], float)[:, 8], data["sensor"][:, 3], rtol=1e-14, atol=0)
    export(recording, tmp_path / "r.mat")
    content = loadmat(tmp_path / "r.mat", simplify_cells=True)
    assert np.array_equal(content["sensor"]["load_cell"], data["sensor"][:, 3])
    assert content["units"]["sensor_load_cell"] == "N"
    with pytest.raises(RigtwinError, match=r"\.csv or \.mat"):
        export(recording, tmp_path / "r.xlsx")


def test_gaps_and_repeats_are_noted(tmp_path, capsys):
    path = tmp_path / "g.mcap"
    with path.open("wb") as file:
        writer = OtherWriter(file)
        writer.start()
        channel = writer.register_channel(
            "/sensor", "json", writer.register_schema("s", "jsonschema", b"{}")
        )
        writer.add_metadata("rigtwin", {"format": "1", "period": "0.001", "config": "{}"})
        for tick in [*range(100), 99, *range(140, 200)]:
            writer.add_message(channel, tick * 1_000_000, b'{"load_cell": 1}', tick * 1_000_000)
        writer.finish()
    notes = " ".join(load(path).notes)
    assert "1 messages on /sensor left out" in notes
    assert "1 gaps in time, the first of 0.041 s at 0.099 s" in notes
    # Who makes a table or a picture of it is told, too.
    assert main(["export", str(path), "-o", str(tmp_path / "e.csv")]) == 0
    assert main(["plot", str(path), "-o", str(tmp_path / "e.png")]) == 0
    assert capsys.readouterr().err.count("1 gaps in time") == 2


def test_foxglove_layout_names_channels_that_exist():
    layout = (EXAMPLE.parents[1] / "docs" / "foxglove-layout.json").read_text()
    known = {f"{channel.topic}.{channel.name}" for channel in CHANNELS}
    paths = {
        word
        for word in layout.replace('"', " ").split()
        if word.startswith(("/sensor.", "/command.", "/truth."))
    }
    assert paths
    assert paths <= known, textwrap.shorten(str(paths - known), 200)


def other_recording(path, rows, times=None, period="0.001"):
    """A JSON recording of /sensor as another program might write it."""
    with path.open("wb") as file:
        writer = OtherWriter(file)
        writer.start()
        channel = writer.register_channel(
            "/sensor", "json", writer.register_schema("s", "jsonschema", b"{}")
        )
        writer.add_metadata("rigtwin", {"format": "1", "period": period, "config": "{}"})
        for tick, row in enumerate(rows):
            stamp = times[tick] if times else tick * 1_000_000
            writer.add_message(channel, stamp, row.encode(), stamp)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ('{"load_cell": [1, 2]}', "load_cell of message 5 is .1, 2.; expected a number"),
        ('{"load_cell": "12.5"}', "expected a number"),
        ('{"load_cell": true}', "expected a number"),
        ('{"load_cell": null}', "is missing; expected a number"),
        ("{}", "is missing; expected a number"),
        ("[1]", "message 5 on /sensor cannot be read"),
        ("{", "message 5 on /sensor cannot be read"),
        ('{"load_cell": 1' + "0" * 400 + "}", "too large"),
        ("[" * 100_000, "cannot be read"),
    ],
)
def test_values_that_are_no_numbers_are_refused_with_their_place(tmp_path, wrong, says):
    rows = ['{"load_cell": 1.0}'] * 10
    rows[5] = wrong
    with pytest.raises(RigtwinError, match=says):
        load(other_recording(tmp_path / "w.mcap", rows))


def test_times_that_make_no_sense_are_refused(tmp_path):
    rows = ['{"load_cell": 1.0}'] * 10
    with pytest.raises(RigtwinError, match=r"messages come every 0\.001 s"):
        load(other_recording(tmp_path / "p.mcap", rows, period="0.0014"))
    for period in ("0.0011", "0.00095"):
        with pytest.raises(RigtwinError, match=r"time stamps within 2 % of the period"):
            load(other_recording(tmp_path / "q.mcap", rows, period=period))
    assert load(other_recording(tmp_path / "q.mcap", rows, period="0.001")).notes == ()
    (note,) = load(other_recording(tmp_path / "q.mcap", rows, period="0.00099")).notes
    assert note.startswith("messages come every 0.001 s, 1 % off the period of 0.00099 s")
    with pytest.raises(RigtwinError, match="expected ns since the start"):
        load(other_recording(tmp_path / "t.mcap", rows, times=[2**63 + n for n in range(10)]))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_time_that_runs_backwards_is_refused(tmp_path):
    path, rows = tmp_path / "b.mcap", ['{"load_cell": 1.0}'] * 300
    other_recording(path, rows, times=[tick * 1_000_000 for tick in range(300, 0, -1)])
    with pytest.raises(RigtwinError, match=r"time on /sensor runs backwards, from 0.300 s"):
        load(path)
    ticks = [1, 0, *range(2, 300)]
    other_recording(path, rows, times=[tick * 1_000_000 for tick in ticks])
    assert "1 messages on /sensor come after later ones" in load(path).notes[0]


def test_a_full_disk_is_one_line(tmp_path):
    full = tmp_path / "full.mcap"
    full.symlink_to("/dev/full")
    with pytest.raises(RigtwinError, match=r"cannot write .*No space left"):
        Writer(full, "x", 1e-3, {})


def test_a_recording_has_one_owner(tmp_path):
    path = tmp_path / "one.mcap"
    with Writer(path, "first", 1e-3, {}) as writer:
        before = path.read_bytes()
        with pytest.raises(RigtwinError, match="is being written by another program"):
            Writer(path, "second", 1e-3, {})
        assert path.read_bytes() == before
        writer.finish("completed")
    with Writer(path, "third", 1e-3, {}) as writer:
        writer.finish("completed")
    assert b"third" in path.read_bytes()
    assert b"first" not in path.read_bytes()


def test_names_that_cannot_be_read_are_not_written(tmp_path):
    for names in (("é",), ("1a",), ("a_b", "aB"), ("a", "a")):
        with pytest.raises(RigtwinError, match="/sensor"):
            Writer(tmp_path / "n.mcap", "x", 1e-3, {}, fields={"/sensor": names})
    assert not (tmp_path / "n.mcap").exists()


def chunks_of(data: bytes) -> list[int]:
    """Where the chunks begin."""
    chunks, at = [], data.find(b"\x04\x00\x00\x00zstd")
    while at >= 0:
        chunks += [at - 37] if data[at - 37] == 6 else []
        at = data.find(b"\x04\x00\x00\x00zstd", at + 1)
    return chunks


@pytest.mark.parametrize("place", [1, 5, 29, 40, 60], ids=str)
def test_a_flipped_bit_costs_one_chunk(tmp_path, place):
    """In its length, its sizes, its compression's name, its data; in a finished file or not."""
    data = written(tmp_path / "r.mcap", ticks=5000)
    whole = (tmp_path / "r.mcap").read_bytes()
    third = chunks_of(whole)[2]
    for end in (len(whole), chunks_of(whole)[-1]):
        damaged = bytearray(whole[:end])
        damaged[third + place] ^= 0x10
        (tmp_path / "d.mcap").write_bytes(damaged)
        recording = load(tmp_path / "d.mcap")
        ticks = np.round(recording.time * 1e3).astype(int)
        expected = 5000 if end == len(whole) else 4750
        assert sorted(set(range(expected)) - set(ticks)) in ([*range(500, 750)], [])
        if len(ticks) < expected:
            assert recording.notes[0].startswith("damaged")
            assert "1 gaps in time, the first of 0.251 s at 0.499 s" in recording.notes
        assert np.array_equal(recording.column("/sensor", "load_cell"), data["sensor"][ticks, 3])


def test_settings_that_are_other_than_written_are_not_believed(tmp_path):
    written(tmp_path / "r.mcap")
    before = load(tmp_path / "r.mcap")
    whole = (tmp_path / "r.mcap").read_bytes()
    name, value = "kp", CONTROLLER["kp"]
    text = json.dumps({name: value}).strip("{}").encode()
    assert whole.count(text) == 1
    (tmp_path / "d.mcap").write_bytes(whole.replace(text, text[:-1] + b"7"))
    recording = load(tmp_path / "d.mcap")
    assert before.controller == CONTROLLER
    assert recording.controller == {}
    assert "wrong checksum" in recording.notes[0]
    assert recording.ticks == before.ticks
