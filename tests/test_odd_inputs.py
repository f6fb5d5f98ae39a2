"""Odd inputs that were once taken without a word, took for ever, or ended in a traceback."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

import rigtwin
from rigtwin.cli import main
from rigtwin.description.document import examine_text
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import number_of
from rigtwin.recording import Writer

TICKS = 200
TIME = np.arange(TICKS) * 1e-3
FORCE = 1200.0 + 50.0 * np.cos(30.0 * TIME)
DATA = {"t": TIME, "x": 0.01 * np.sin(30.0 * TIME), "F": FORCE}


def mapping(**force: object) -> dict[str, Any]:
    return {
        "machine": "damper-bench",
        "time": {"column": "t", "unit": "s"},
        "channels": {
            "/sensor.displacement": {"column": "x", "unit": "m"},
            "/sensor.force": {"column": "F", "unit": "N", **force},
        },
    }


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def rows(head: str = "t,x,F") -> str:
    columns = zip(*DATA.values(), strict=True)
    return f"{head}\n" + "".join(f"{t:.4f},{x:.7f},{f:.5f}\n" for t, x, f in columns)


# Imports


@pytest.mark.parametrize("unit", ["mm", "V", "Nm"])
def test_a_unit_of_another_quantity_is_refused(tmp_path, unit):
    with pytest.raises(RigtwinError, match=f"/sensor.force is in '{unit}'; expected a unit of N"):
        rigtwin.import_data(DATA, mapping(unit=unit), tmp_path / "r.mcap")
    # A scale converts quantities: 186 N/V.
    scaled = mapping(unit="V", scale=186.0)
    recording = rigtwin.import_data(DATA, scaled, tmp_path / "r.mcap")
    assert np.allclose(recording["/sensor.force"], 186.0 * FORCE)


def test_a_masked_value_is_no_number(tmp_path):
    masked = np.ma.masked_array(FORCE, mask=np.arange(TICKS) == 50)
    with pytest.raises(RigtwinError, match=r"force is not a number in 1 rows, the first at 0.05 s"):
        rigtwin.import_data({**DATA, "F": masked}, mapping(), tmp_path / "r.mcap")
    whole = rigtwin.import_data(
        {**DATA, "F": np.ma.masked_array(FORCE)}, mapping(), tmp_path / "r.mcap"
    )
    assert np.allclose(whole["/sensor.force"], FORCE)


@pytest.mark.parametrize(("unit", "per_second"), [("ns", 1e9), ("fs", 1e15), ("as", 1e18)])
def test_times_of_any_unit_of_numpy_are_read(tmp_path, unit, per_second):
    times = np.round(TIME * per_second).astype(np.int64).astype(f"m8[{unit}]")
    recording = rigtwin.import_data({**DATA, "t": times}, mapping(), tmp_path / "r.mcap")
    assert recording.period == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("column", "values", "told"),
    [
        ("t", np.arange(TICKS).astype("m8"), "times without a unit"),
        ("F", np.array([10**400] * TICKS, object), "int too large"),
    ],
)
def test_arrays_that_cannot_be_numbers_are_refused_in_one_line(tmp_path, column, values, told):
    with pytest.raises(RigtwinError, match=told):
        rigtwin.import_data({**DATA, column: values}, mapping(), tmp_path / "r.mcap")


def test_numbers_as_bytes_are_numbers(tmp_path):
    spelled = np.array([repr(float(force)) for force in FORCE], "S")
    recording = rigtwin.import_data({**DATA, "F": spelled}, mapping(), tmp_path / "r.mcap")
    assert np.allclose(recording["/sensor.force"], FORCE)


def test_signs_between_thousands_are_not_taken_the_wrong_way_round():
    assert number_of("1.234,5", ",") == 1234.5
    assert number_of("-12.345.678,5e1", ",") == -123456785.0
    for cell in ("1,234.5", "1.23,4", "1.2345,6", "1234.567,8"):
        with pytest.raises(ValueError, match=cell):
            number_of(cell, ",")


def test_a_header_that_numbers_the_columns_is_no_row(tmp_path):
    numbered = mapping() | {"time": {"column": "0", "unit": "s"}}
    numbered["channels"] = {
        "/sensor.displacement": {"column": "1", "unit": "m"},
        "/sensor.force": {"column": "2", "unit": "N"},
    }
    path = write(tmp_path / "log.csv", rows("0,1,2"))
    recording = rigtwin.import_data(path, numbered, tmp_path / "r.mcap")
    assert recording.ticks == TICKS
    assert recording["/sensor.force"][0] == pytest.approx(FORCE[0])
    # Rows of whole numbers may begin so by themselves.
    counts = "".join(f"{n},{n + 1},{n + 2}\n" for n in range(20))
    plain = {**mapping(), "time": {"period": 1e-3}}
    plain["channels"] = {"/sensor.force": {"column": "column3", "unit": "N"}}
    path = write(tmp_path / "counts.csv", counts)
    assert rigtwin.import_data(path, plain, tmp_path / "r.mcap").ticks == 20


def test_a_file_that_ends_within_a_line_says_so(tmp_path):
    path = write(tmp_path / "log.csv", rows()[:-4])
    recording = rigtwin.import_data(path, mapping(), tmp_path / "r.mcap")
    assert any("the last line has no end" in line for line in recording.report)
    path = write(tmp_path / "log.csv", rows())
    recording = rigtwin.import_data(path, mapping(), tmp_path / "r.mcap")
    assert not any("the last line has no end" in line for line in recording.report)


def test_very_wide_files_are_read_or_refused_with_a_number(tmp_path):
    head = "t,x,F," + ",".join(f"c{n}" for n in range(5000))
    cells = ",1.5" * 5000
    body = "".join(f"{t:.4f},0.01,1.5{cells}\n" for t in TIME[:40])
    path = write(tmp_path / "wide.csv", f"{head}\n{body}")
    assert rigtwin.import_data(path, mapping(), tmp_path / "r.mcap").ticks == 40
    path = write(tmp_path / "wider.csv", "1," * 2_000_000 + "\n")
    with pytest.raises(RigtwinError, match="has 2000001 cells; expected at most 20000"):
        rigtwin.import_data(path, mapping(), tmp_path / "r.mcap")


def test_resampling_over_a_long_gap_is_refused_before_memory_ends(tmp_path):
    late = np.concatenate([TIME[:100], TIME[100:] + 1e9])
    resampled = {**mapping(), "time": {"column": "t", "unit": "s", "resample": 1e-3}}
    with pytest.raises(RigtwinError, match=r"makes 1e\+12 ticks of 2 signals.*at most 3e\+08"):
        rigtwin.import_data({**DATA, "t": late}, resampled, tmp_path / "r.mcap")


@pytest.mark.parametrize("table", ["channels", "columns"])
def test_a_map_in_memory_may_have_keys_that_are_no_texts(tmp_path, table):
    with pytest.raises(RigtwinError, match=rf"\[{table}\] .?5"):
        rigtwin.import_data(DATA, {**mapping(), table: {5: "x"}}, tmp_path / "r.mcap")


# Recordings


def recorded(path: Path, messages: list[dict[str, object]]) -> Path:
    about = {"format": "1", "machine": "damper-bench", "experiment": "e", "period": "0.001"}
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        writer.add_metadata("rigtwin", about)
        channel = writer.register_channel(
            "/sensor", "json", writer.register_schema("s", "jsonschema", b"{}")
        )
        for tick, message in enumerate(messages):
            writer.add_message(channel, tick * 10**6, json.dumps(message).encode(), tick * 10**6)
        writer.finish()
    return path


@pytest.mark.parametrize("odd", ["5", None])
def test_a_channel_that_is_no_number_in_one_message_is_left_out_with_a_note(tmp_path, odd):
    messages: list[dict[str, object]] = [{"x": 1.0, "force": 2.0, "mode": "on"} for _ in range(9)]
    messages[4]["force"] = odd
    recording = rigtwin.load(recorded(tmp_path / "r.mcap", messages))
    assert recording.channels == ("/sensor.x",)
    assert recording.notes == (
        "/sensor.force is not a number in 1 messages, the first is message 4; "
        "the channel is left out",
    )


def test_an_empty_stretch_and_wrong_keys_are_one_line(tmp_path):
    with Writer(tmp_path / "r.mcap", "e", 1e-3, {}, "damper-bench", {"/sensor": ("force",)}) as w:
        w.append(sensor=FORCE[:, None])
    recording = rigtwin.load(tmp_path / "r.mcap")
    with pytest.raises(RigtwinError, match="it has 0 ticks; expected two or more"):
        recording.between(0.1, 0.05).plot(tmp_path / "x.png")
    key: Any = 5
    with pytest.raises(RigtwinError, match="5: expected a channel such as"):
        _ = recording[key]
    with pytest.raises(RigtwinError, match="start nan s, until 0.199 s: expected finite times"):
        recording.plot(tmp_path / "x.png", float("nan"))


# Descriptions

HEAD = '[machine]\nname = "a"\nmodel = "a.xml"\n'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (HEAD + "title = [1]\n[components.a]\n", "[machine] title: [1]: expected a text"),
        (HEAD.replace("a.xml", "x" * 5000), "expected the name of an MJCF file"),
        (HEAD + "[components.class]\njoint = 'j'\n", "'class' cannot be a component's name"),
        (HEAD + "[[replays]]\nname = -1\nmoved_by = 'u'\nobserve = ['q']\n", "name = -1: expected"),
    ],
)
def test_odd_values_of_a_description_are_mistakes(tmp_path, text, told):
    write(
        tmp_path / "a.xml",
        "<mujoco><worldbody><body><joint name='j'/><geom size='.1'/></body></worldbody>"
        "<actuator><motor name='u' joint='j'/></actuator>"
        "<sensor><jointpos name='q' joint='j'/></sensor></mujoco>",
    )
    machine, mistakes = examine_text(text, tmp_path / "a.toml")
    assert machine is None
    assert any(told in mistake for mistake in mistakes), mistakes


@pytest.mark.parametrize(
    ("inside", "told"),
    [
        (
            "<asset><hfield name='h' nrow='100000' ncol='100000' size='1 1 1 1'/></asset>",
            r"<hfield> has 1e\+10 cells; expected at most 10000000",
        ),
        (
            "<worldbody><replicate count='3000' offset='0 0 0'><body><geom size='.1'/></body>"
            "</replicate><body><freejoint/><geom size='.1'/></body></worldbody>",
            "out of memory",
        ),
    ],
)
def test_models_that_take_all_memory_are_refused_in_one_line(tmp_path, inside, told):
    path = write(tmp_path / "a.xml", f"<mujoco>{inside}</mujoco>")
    with pytest.raises(RigtwinError, match=told):
        Mechanism(path)


# Calls and commands


@pytest.mark.parametrize(
    "call",
    [
        lambda: rigtwin.blindcheck(seed=float("nan")),  # type: ignore[arg-type]
        lambda: rigtwin.blindcheck(progress=b"x"),  # type: ignore[arg-type]
        lambda: rigtwin.run("emps", "positioning", progress=5),  # type: ignore[arg-type]
        lambda: rigtwin.dry_run("imposed", "pci-6229", path=(1,)),  # type: ignore[arg-type]
    ],
)
def test_arguments_of_a_wrong_type_are_refused_before_the_work(call, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RigtwinError, match=": expected"):
        call()
    assert not list(tmp_path.iterdir())


def test_a_path_that_is_too_long_is_one_line():
    with pytest.raises(RigtwinError, match="File name too long"):
        rigtwin.machine("x" * 5000)


def test_a_figure_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys):
    path = tmp_path / "no.mcap"
    assert main(["compare", str(path), "--json", str(tmp_path / "no" / "x.json")]) == 1
    assert "its folder does not exist" in capsys.readouterr().err


def test_watching_another_machine_ends_at_once():
    example = Path(__file__).parent.parent / "examples" / "nominal-imposed.mcap"
    with pytest.raises(RigtwinError, match="it is of machine 'suspension-rig'"):
        rigtwin.watch(example, machine="emps")
