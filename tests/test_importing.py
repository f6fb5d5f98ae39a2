"""Import: files as spreadsheets, loggers and MATLAB write them; what is odd in them is said; a
mistake is one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.importing.convert import convert
from rigtwin.importing.selection import Selection
from rigtwin.importing.table import formats, read
from rigtwin.importing.text import find_layout
from rigtwin.importing.units import UNITS, unit_of
from rigtwin.recording import load

TICKS = 300
TIME = np.arange(TICKS) * 0.002
POSITION = 20.0 * np.sin(8.0 * TIME)
FORCE = 150.0 * np.cos(8.0 * TIME + 2.0) + 3.0
MAP = """
machine = "bench"
experiment = "sines"
[time]
column = "t"
[channels]
"/sensor.displacement" = { column = "x", unit = "mm" }
"/sensor.force" = { column = "f", unit = "N" }
"""


def text(
    separator: str = ",", decimal: str = ".", head: str = "", names: str = "t,x,f", units: str = ""
) -> str:
    rows = [f"{t:.4f},{x:.6f},{f:.5f}" for t, x, f in zip(TIME, POSITION, FORCE, strict=True)]
    body = [row.replace(",", "|").replace(".", decimal).replace("|", separator) for row in rows]
    lines = [*([head] if head else []), *([names.replace(",", separator)] if names else [])]
    return "\n".join([*lines, *([units.replace(",", separator)] if units else []), *body]) + "\n"


def imported(folder: Path, data: str | bytes, map_text: str = MAP, name: str = "data.csv"):
    (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
    (folder / "map.toml").write_text(map_text)
    report = convert([folder / name], folder / "map.toml", folder / "out.mcap")
    return load(folder / "out.mcap"), report


def assert_right(recording) -> None:
    assert recording.machine == "bench"
    assert recording.period == 0.002
    np.testing.assert_allclose(
        recording.column("/sensor", "displacement"), 1e-3 * POSITION, atol=1e-8
    )
    np.testing.assert_allclose(recording.column("/sensor", "force"), FORCE, atol=1e-4)


@pytest.mark.parametrize(
    "data",
    [
        text(),
        text(";"),
        text("\t"),
        text("|"),
        text(" "),
        text(";", ","),
        text("\t", ","),
        text(";", ",", "Logger 7;;\nBediener: Müller;;"),
        text(",", ".", "# made by nobody\n\n# 12 March 2026"),
        text(",", ".", units="s,mm,N"),
        text(";", ",", names="t [s];x [mm];f [N]".replace(";", ",")),
        text().replace("\n", "\r\n"),
        "\ufeff" + text(),
        text().replace("\n", ",\n"),
        text(" ").replace(" ", "    "),
    ],
    ids=range(15),
)
def test_text_is_read_however_it_is_written(tmp_path: Path, data: str):
    assert_right(imported(tmp_path, data)[0])


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "utf-8-sig"])
def test_any_encoding(tmp_path: Path, encoding: str):
    assert_right(imported(tmp_path, text(";", ",", "Prüfstand 3;;").encode(encoding))[0])


def test_units_of_the_file_are_used_where_the_map_has_none(tmp_path: Path):
    bare = MAP.replace(', unit = "mm"', "").replace(', unit = "N"', "")
    assert_right(imported(tmp_path, text(units="s,mm,N"), bare)[0])
    assert_right(imported(tmp_path, text(names="t (s),x (mm),f (N)"), bare)[0])


def test_scale_sign_offset_and_constants(tmp_path: Path):
    changed = MAP.replace('unit = "N"', 'unit = "N", scale = 2.0, sign = -1, offset = 5.0')
    recording, _ = imported(tmp_path, text(), changed + '"/command.pulse" = { constant = 4.0 }\n')
    np.testing.assert_allclose(recording.column("/sensor", "force"), 5.0 - 2.0 * FORCE, atol=1e-3)
    assert np.all(recording.column("/command", "pulse") == 4.0)


def test_time_of_day_and_milliseconds(tmp_path: Path):
    stamps = [f"2026-03-01T10:{int(t) // 60:02d}:{t % 60:09.6f}" for t in TIME]
    lines = text().splitlines()
    rows = [f"{s},{line.split(',', 1)[1]}" for s, line in zip(stamps, lines[1:], strict=True)]
    assert_right(imported(tmp_path, "\n".join(["t,x,f", *rows]))[0])
    rows = [
        f"{1e3 * t:.1f},{line.split(',', 1)[1]}" for t, line in zip(TIME, lines[1:], strict=True)
    ]
    assert_right(
        imported(
            tmp_path,
            "\n".join(["t,x,f", *rows]),
            MAP.replace('column = "t"', 'column = "t"\nunit = "ms"'),
        )[0]
    )


def test_matlab_files(tmp_path: Path):
    savemat(
        tmp_path / "data.mat",
        {"t": TIME[:, None], "x": POSITION[:, None], "f": FORCE[:, None], "gain": 3.0},
    )
    (tmp_path / "map.toml").write_text(MAP)
    convert([tmp_path / "data.mat"], tmp_path / "map.toml", tmp_path / "out.mcap")
    assert_right(load(tmp_path / "out.mcap"))
    savemat(tmp_path / "data.mat", {"log": {"t": TIME, "both": np.column_stack([POSITION, FORCE])}})
    names = (
        MAP.replace('"t"', '"log.t"').replace('"x"', '"log.both:1"').replace('"f"', '"log.both:2"')
    )
    (tmp_path / "map.toml").write_text(names)
    convert([tmp_path / "data.mat"], tmp_path / "map.toml", tmp_path / "out.mcap")
    assert_right(load(tmp_path / "out.mcap"))


def test_matlab_v73(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "data.mat", "w", userblock_size=512) as file:
        file["t"], file["x"] = TIME[None, :], POSITION[None, :]
        file.create_group("s")["f"] = FORCE[None, :]
    with (tmp_path / "data.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    (tmp_path / "map.toml").write_text(MAP.replace('column = "f"', 'column = "s.f"'))
    convert([tmp_path / "data.mat"], tmp_path / "map.toml", tmp_path / "out.mcap")
    assert_right(load(tmp_path / "out.mcap"))


def test_parquet(tmp_path: Path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    parquet.write_table(
        pyarrow.table({"t": TIME, "x": POSITION, "f": FORCE}), tmp_path / "data.parquet"
    )
    (tmp_path / "map.toml").write_text(MAP)
    convert([tmp_path / "data.parquet"], tmp_path / "map.toml", tmp_path / "out.mcap")
    assert_right(load(tmp_path / "out.mcap"))


WORDS = [
    f"{line},{word}"
    for line, word in zip(text().splitlines()[1:], ["RUN", "hold"] * 150, strict=True)
]


def with_time(stamps: list[str], names: str = "t,x,f") -> str:
    """The data with other time cells."""
    rows = [line.split(",", 1)[1] for line in text().splitlines()[1:]]
    return "\n".join([names, *(f"{s},{row}" for s, row in zip(stamps, rows, strict=True))]) + "\n"


def test_columns_of_words_are_left_out(tmp_path: Path):
    recording, report = imported(tmp_path, "\n".join(["t,x,f,state", *WORDS]))
    assert_right(recording)
    assert "words in state" in report[0]


def test_rows_that_break_off_are_said(tmp_path: Path):
    cut = text(names="t,x,f,u").splitlines()
    cut = [cut[0], *(f"{line},{n}" for n, line in enumerate(cut[1:]))]
    cut[100] = cut[100].rpartition(",")[0]
    cut[200] += ",operator looked away"
    recording, report = imported(tmp_path, "\n".join([*cut, "0.6,2"]))
    assert_right(recording)
    said = "\n".join(report)
    assert "the last line, 302, breaks off and is left out" in said
    assert "1 lines break off, the first is 101" in said
    assert "1 lines have words after their last cell, the first is 201" in said


CLOCKS = [f"{int(t) // 60:02d}:{t % 60:07.4f}" for t in TIME]


@pytest.mark.parametrize(
    "stamps",
    [
        [f"22.11.2026 10:{clock}" for clock in CLOCKS],
        [f"11/22/2026 10:{clock} PM" for clock in CLOCKS],
        [f"22/11/2026 10:{clock}" for clock in CLOCKS],
        [f"2026/11/22 10:{clock}" for clock in CLOCKS],
        [f"22-Nov-2026 10:{clock}" for clock in CLOCKS],
        [f"2026-11-22T10:{clock}+02:00" for clock in CLOCKS],
        [f"10:{clock} am" for clock in CLOCKS],
        [f"{'23:59' if t < 0.1 else '00:00'}:{(59.9 + t) % 60.0:07.4f}" for t in TIME],
        [
            f"2026-0{2 if t < 0.1 else 3}-{28 if t < 0.1 else 1:02d} "
            f"{'23:59' if t < 0.1 else '00:00'}:{(59.9 + t) % 60.0:07.4f}"
            for t in TIME
        ],
        [
            f"{'12/3' if t < 0.1 else '12/4'}/2026 "
            f"{'23:59' if t < 0.1 else '00:00'}:{(59.9 + t) % 60.0:07.4f}"
            for t in TIME
        ],
    ],
    ids=range(10),
)
def test_dates_however_they_are_written(tmp_path: Path, stamps: list[str]):
    assert_right(imported(tmp_path, with_time(stamps))[0])


def test_a_date_and_a_time_in_two_columns(tmp_path: Path):
    stamps = [f"22.11.2026,10:{clock}" for clock in CLOCKS]
    two = MAP.replace('column = "t"', 'column = ["day", "clock"]')
    assert_right(imported(tmp_path, with_time(stamps, "day,clock,x,f"), two)[0])


RECORDS = [{"t": t, "x": x, "f": f} for t, x, f in zip(TIME, POSITION, FORCE, strict=True)]
NESTED = [{"t": r["t"], "at": {"x": r["x"]}, "f": [r["f"], 0], "on": "yes"} for r in RECORDS]


def test_json_s_keys_stand_there_once(tmp_path: Path):
    (tmp_path / "a.json").write_text('{"t": [0, 1], "t": [0, 2], "x": [1, 2]}')
    with pytest.raises(RigtwinError, match="not valid JSON: 't' is listed twice"):
        read(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("name", "data", "changes"),
    [
        ("a.json", json.dumps(RECORDS), {}),
        ("a.json", json.dumps({"rig": "one", "kp": 3, "entries": RECORDS}), {}),
        ("a.json", json.dumps({key: [r[key] for r in RECORDS] for key in "txf"}), {}),
        ("a.jsonl", "\n".join(map(json.dumps, RECORDS)), {}),
        ("a.json", json.dumps(NESTED), {'"x"': '"at.x"', '"f"': '"f:1"'}),
    ],
    ids=["records", "inside", "lists", "lines", "nested"],
)
def test_json(tmp_path: Path, name: str, data: str, changes: dict[str, str]):
    changed = MAP
    for old, new in changes.items():
        changed = changed.replace(f"column = {old}", f"column = {new}")
    assert_right(imported(tmp_path, data, changed, name)[0])


def test_a_counter_that_wraps_around(tmp_path: Path):
    """16 bits, unsigned, about zero: and what the import says if the map does not."""
    counts = np.round(50.0 * POSITION).astype(int) % 65536
    rows = [f"{t},{n},{f}" for t, n, f in zip(TIME, counts, FORCE, strict=True)]
    data = "\n".join(["t,x,f", *rows])
    wraps = MAP.replace('unit = "mm"', 'unit = "mm", scale = 0.02, wrap = 65536')
    recording, _ = imported(tmp_path, data, wraps)
    found = recording.column("/sensor", "displacement")
    np.testing.assert_allclose(found, 1e-3 * POSITION, atol=1.1e-5)
    _, report = imported(tmp_path, data)
    assert any("say wrap = 65536" in line for line in report)


DERIVED = """
machine = "bench"
[time]
column = "t"
[columns]
travel = { column = "x", unit = "mm" }
load = "f"
[constants]
mass = 2.5
[channels]
"/sensor.position" = { column = "x", unit = "mm" }
"/sensor.velocity" = { formula = "derivative(travel)" }
"/command.force" = { formula = "load - mass * derivative(derivative(travel))" }
"/command.mean" = { formula = "mean(load, 5) + 0 * f" }
"/command.ramp" = { formula = "integral(3) + 0 * f" }
"""


def test_channels_are_worked_out_without_lateness(tmp_path: Path):
    recording, _ = imported(tmp_path, text(), DERIVED)
    inside = slice(3, -3)
    velocity, force, mean = (
        recording.column(topic, name)[inside]
        for topic, name in (("/sensor", "velocity"), ("/command", "force"), ("/command", "mean"))
    )
    # x = 20 mm sin 8t, f = 150 N cos(8t + 2) + 3 N.
    np.testing.assert_allclose(velocity, 0.16 * np.cos(8.0 * TIME)[inside], atol=2e-5)
    inertia = -2.5 * 1.28 * np.sin(8.0 * TIME)
    np.testing.assert_allclose(force, (FORCE - inertia)[inside], atol=1e-3)
    np.testing.assert_allclose(mean, FORCE[inside], atol=0.05)
    ramp = recording.column("/command", "ramp")
    np.testing.assert_allclose(ramp, 3.0 * TIME, atol=1e-9)


def test_files_side_by_side(tmp_path: Path):
    """Two files whose columns have the same names, as an arm's positions and currents."""
    for name, column in (("pos", POSITION), ("curr", FORCE)):
        (tmp_path / f"{name}.csv").write_text("J1\n" + "\n".join(f"{v:.6f}" for v in column))
    both = """
machine = "bench"
[time]
period = 0.002
[columns]
p = { column = "pos.J1", unit = "mm" }
[channels]
"/sensor.displacement" = { formula = "p / 1" }
"/sensor.force" = { column = "curr.J1", unit = "N" }
"""
    (tmp_path / "map.toml").write_text(both)
    files = [tmp_path / "pos.csv", tmp_path / "curr.csv"]
    convert(files, tmp_path / "map.toml", tmp_path / "out.mcap")
    assert_right(load(tmp_path / "out.mcap"))
    files[1].write_text("J1\n1\n2\n3\n4\n5\n6\n")
    with pytest.raises(RigtwinError, match="equal numbers of rows; they have: pos 300, curr 6"):
        convert(files, tmp_path / "map.toml", tmp_path / "out.mcap")


def test_what_is_odd_is_said(tmp_path: Path):
    lines = text().splitlines()
    lines = [*lines[:100], lines[99], *lines[100:]]
    clipped = [
        f"{a},{b},{min(float(c), 140.0)}" for a, b, c in (line.split(",") for line in lines[1:])
    ]
    recording, report = imported(
        tmp_path, "\n".join(["t,x,f", *clipped]) + "\n", MAP + '"/command.u" = { constant = 1.0 }\n'
    )
    said = "\n".join(report)
    assert recording.ticks == TICKS
    assert "1 rows were there twice" in said
    assert "/sensor.force is cut off above 140" in said
    assert "/command.u is 1 throughout" in said


def test_resampling_only_when_asked(tmp_path: Path):
    lines = text().splitlines()
    gappy = "\n".join([*lines[:100], *lines[120:]])
    with pytest.raises(RigtwinError, match=r"1 gaps in time, the first of 0\.042 s"):
        imported(tmp_path, gappy)
    recording, report = imported(
        tmp_path, gappy, MAP.replace('column = "t"', 'column = "t"\nresample = 0.004')
    )
    assert recording.period == 0.004
    assert any("resampled" in line for line in report)
    recording, _ = imported(
        tmp_path, gappy, MAP.replace('column = "t"', 'column = "t"\nuntil = 0.19')
    )
    assert recording.ticks == 96


BAD_DATA = [
    ("", "no lines of numbers"),
    ("hello\nworld\n", "no lines of numbers"),
    (text(names="t,y,f"), "no column 'x'; there are t, y, f"),
    (text(names="t,x,x"), "2 columns are named 'x'"),
    (text() + "1,2,3,4\n", "line 302 has 4 cells; expected 3"),
    (text() + "0.6,two,3\n", "is not a number in 1 rows, the first at 0.6 s ('two' in line 302)"),
    (text() + "late,2,3\n", "time column 't' is not a number in 'late' in line 302"),
    (text() + "0.6,,3\n", "is not a number in 1 rows, the first at 0.6 s"),
    (text() + "0.1,2,3\n", "time goes back in row 301"),
    (text() + "0.5980,2,3\n", "has the same time as the one before"),
    (b"\x00\x01\x02\x03" * 200, "no lines of numbers"),
]


@pytest.mark.parametrize(("data", "said"), BAD_DATA, ids=range(len(BAD_DATA)))
def test_bad_data_is_one_line(tmp_path: Path, data, said: str):
    with pytest.raises(RigtwinError) as caught:
        imported(tmp_path, data)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out.mcap").exists()


BAD_MAPS = [
    (MAP.replace("machine", "machin"), "unknown key 'machin'"),
    (MAP.replace('column = "t"', ""), "either column"),
    (MAP.replace('column = "t"', 'column = "t"\nunit = "mm"'), "expected s, ms"),
    (MAP.replace('unit = "mm"', 'unit = "furlong"'), "unknown unit 'furlong'"),
    (MAP.replace('unit = "mm"', "sign = 2"), "expected 1 or -1"),
    (MAP.replace('unit = "mm"', "scale = 1e308"), "expected numbers below 1e+15"),
    (MAP.replace('column = "t"', 'column = ["t", "t"]'), "a column is listed twice"),
    (MAP.replace('unit = "mm"', "scale = 0"), "expected anything else"),
    (MAP.replace('unit = "mm"', 'scale = "2"'), "expected a number"),
    (MAP.replace('unit = "mm"', "scal = 2"), "unknown key 'scal'"),
    (MAP.replace('"/sensor.force"', '"force"'), 'expected "/command.NAME"'),
    (MAP.split("[channels]")[0], "[channels] is missing"),
    (MAP + '"/sensor.a" = { formula = "2 * y" }', "no column 'y'; there are t, x, f"),
    (MAP + '"/sensor.a" = { formula = "2 *" }', "is not a formula"),
    (MAP + '"/sensor.a" = { formula = "3.0" }', "it names no column"),
    (MAP + '"/sensor.a" = { formula = "x", unit = "mm" }', "unit goes with a column"),
    (
        MAP + '"/sensor.a" = { formula = "1 / (x - x)" }',
        "is inf at 0 s; expected numbers below",
    ),
    (MAP + '[columns]\n"a b" = "x"', "'a b': expected a name of letters"),
    (MAP + '[columns]\na = "x"\n[constants]\na = 1', "[columns] has that name too"),
    (MAP + "[constants]\na = 'x'", "[constants] a = 'x': expected a number"),
    (MAP.replace('unit = "mm"', "wrap = 1"), "wrap = 1: expected a number from 2"),
    (MAP.replace('column = "t"', "column = 3"), "a date's and a time's"),
    (MAP.replace('column = "x", unit = "mm"', ""), "either column"),
    (MAP + "[controller]\nkp = [1]\n", "a table of settings"),
    ("machine = ", "not valid TOML"),
]


@pytest.mark.parametrize(("map_text", "said"), BAD_MAPS, ids=range(len(BAD_MAPS)))
def test_a_bad_map_is_one_line(tmp_path: Path, capsys, map_text: str, said: str):
    (tmp_path / "data.csv").write_text(text())
    (tmp_path / "map.toml").write_text(map_text)
    arguments = [
        "import",
        str(tmp_path / "data.csv"),
        "--map",
        str(tmp_path / "map.toml"),
        "-o",
        str(tmp_path / "out.mcap"),
    ]
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["data.xlsx", "data.mat", "data.parquet"])
def test_other_files_are_refused(tmp_path: Path, name: str):
    with pytest.raises(RigtwinError):
        imported(tmp_path, b"nothing of the sort" * 20, MAP, name)
    with pytest.raises(RigtwinError, match="No such file"):
        read(tmp_path / "absent.csv")


def test_every_unit_has_an_si_unit_that_is_one_itself():
    for name, (base, factor) in UNITS.items():
        assert factor > 0.0
        assert UNITS[base] == (base, 1.0), name
    assert unit_of("[mm]") == ("m", 1e-3)
    for text, (base, factor) in {
        "kip": ("N", 4448.2216152605),
        "KIPS": ("N", 4448.2216152605),
        "Degrees": ("rad", np.pi / 180.0),
        "RPM": ("rad/s", np.pi / 30.0),
        "N·m": ("Nm", 1.0),
        "lbf-in": ("Nm", 0.0254 * 4.4482216152605),
        "oz.in": ("Nm", 0.0254 * 4.4482216152605 / 16.0),
    }.items():
        assert unit_of(text) == (base, pytest.approx(factor))
    for ambiguous in ("Mm", "MM", "ma"):
        with pytest.raises(RigtwinError, match="unknown unit"):
            unit_of(ambiguous)


def test_thousands_are_no_columns():
    found = find_layout(["a;b", "1.234,5;2", "1.235,5;3", "1.236,5;4", "1.237,5;5", "1.238,5;6"])
    assert found is not None
    assert (found.separator, found.decimal) == (";", ",")


def test_a_column_may_be_named_as_the_first_line_does_with_its_unit(tmp_path):
    (tmp_path / "log.csv").write_text(
        "time [s],force [kip]\n" + "".join(f"{n * 1e-3},{0.001 * n}\n" for n in range(50))
    )
    (tmp_path / "map.toml").write_text(
        'machine = "damper-bench"\n[time]\ncolumn = "time [s]"\n[channels]\n'
        '"/sensor.force" = { column = "force [kip]", unit = "lbf", scale = 1000 }\n'
    )
    out = tmp_path / "log.mcap"
    convert([tmp_path / "log.csv"], tmp_path / "map.toml", out)
    found = load(out)
    assert found.column("/sensor", "force")[-1] == pytest.approx(0.049 * 4448.2216, rel=1e-6)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("déplacement", "force"), "letters without accents"),
        (("displacement", "ﬀorce"), "letters without accents"),
        (("a_b", "aB"), "cannot have both a_b and aB"),
    ],
)
def test_a_channel_that_no_recording_can_hold_is_refused(tmp_path, names, said):
    first, second = names
    wrong = MAP.replace("displacement", first).replace("sensor.force", f"sensor.{second}")
    with pytest.raises(RigtwinError, match=said):
        imported(tmp_path, text(), wrong)
    assert not (tmp_path / "out.mcap").exists()


def test_lines_and_cells_of_any_length_are_read(tmp_path):
    long = "1" + "0" * 140_000
    lines = text().splitlines()
    lines[150] = lines[150].rsplit(",", 1)[0] + f",{long}"
    with pytest.raises(RigtwinError, match="/sensor.force is not a number"):
        imported(tmp_path, "\n".join(lines))
    wide = "\n".join([",".join(["1.50000000000000000"] * 8000)] * 6)
    (tmp_path / "wide.csv").write_text(wide)
    assert len(read(tmp_path / "wide.csv").values) == 8000


@pytest.mark.parametrize("share", [0.05, 0.1, 0.3, 0.6, 0.9, 0.99])
def test_a_matlab_file_that_is_cut_off_is_one_line(tmp_path, share):
    savemat(tmp_path / "m.mat", {"t": TIME, "x": POSITION})
    whole = (tmp_path / "m.mat").read_bytes()
    (tmp_path / "d.mat").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RigtwinError, match=r"d\.mat") as error:
        read(tmp_path / "d.mat")
    assert "\n" not in str(error.value)


def test_a_link_to_nowhere_is_no_column(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "link.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = TIME
        file["x"] = h5py.SoftLink("/nowhere")
    data = bytearray(path.read_bytes())
    data[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(data)
    assert list(read(path).values) == ["t"]
    path.write_bytes(data[:1500])
    with pytest.raises(RigtwinError, match=r"link\.mat"):
        read(path)


def test_only_the_mapped_datasets_of_matlab_v73_are_read(tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["x"] = TIME[None, :], np.vstack([POSITION, FORCE])
        file.create_group("s")["large"] = np.zeros((3, 1000))
        file["s/above"] = file["/"]
    data = bytearray(path.read_bytes())
    data[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(data)
    taken = []
    original = h5py.Dataset.__getitem__
    monkeypatch.setattr(
        h5py.Dataset,
        "__getitem__",
        lambda item, key: taken.append(item.name) or original(item, key),
    )
    found = read(path, Selection(frozenset({"t", "x:2"})))
    assert sorted(taken) == ["/t", "/x"]
    assert set(found.values) == {"t", "x:2"}
    np.testing.assert_array_equal(found.values["x:2"], FORCE)
    assert {"x:1", "s.large:3"} <= set(found.names)


def test_every_module_with_a_format_is_found():
    titles = [known.title for known in formats()]
    assert len(set(titles)) == len(titles) >= 7
    endings = [ending for known in formats() for ending in known.endings]
    assert len(set(endings)) == len(endings)


def in_another_unit(factor: float, digits: int) -> str:
    """The data with their time in units of `factor` seconds."""
    rows = [
        f"{t / factor:.{digits}f},{x:.6f},{f:.5f}"
        for t, x, f in zip(TIME, POSITION, FORCE, strict=True)
    ]
    return "\n".join(["t,x,f", *rows]) + "\n"


@pytest.mark.parametrize(
    ("factor", "digits", "unit"),
    [(86_400.0, 13, "d"), (1e-3, 1, "ms"), (1e-6, 0, "us"), (1e-9, 0, "ns")],
)
def test_a_time_without_a_unit_is_asked_for_where_seconds_are_implausible(
    tmp_path: Path, factor: float, digits: int, unit: str
):
    data = in_another_unit(factor, digits)
    with pytest.raises(RigtwinError) as caught:
        imported(tmp_path, data)
    said = str(caught.value)
    assert said.startswith(str(tmp_path / "data.csv")), "the input, not the output"
    assert f'"{unit}" (a step of 0.002 s)' in said
    assert not (tmp_path / "out.mcap").exists()
    stated = MAP.replace('column = "t"', f'column = "t"\nunit = "{unit}"')
    recording, _ = imported(tmp_path, data, stated)
    assert recording.period == pytest.approx(0.002, rel=1e-5)


def test_an_implausible_period_in_a_stated_unit_is_refused(tmp_path: Path):
    stated = MAP.replace('column = "t"', 'column = "t"\nunit = "d"')
    with pytest.raises(
        RigtwinError, match=r"data.csv: the time column's step is 172.8 s; expected"
    ):
        imported(tmp_path, text(), stated)


def test_seconds_that_are_assumed_are_said(tmp_path: Path):
    _, report = imported(tmp_path, text())
    assert "time: no unit is said of column 't'; taken as s" in report
    _, report = imported(tmp_path, text(units="s,mm,N"))
    assert not any("no unit is said of column 't'" in line for line in report)


@pytest.mark.parametrize("cell", ['"1,234.5"', "0x1F"])
def test_a_column_of_other_numbers_is_said_with_its_cell(tmp_path: Path, cell: str):
    lines = [line.rsplit(",", 1)[0] + f",{cell}" for line in text().splitlines()[1:]]
    with pytest.raises(RigtwinError) as caught:
        imported(tmp_path, "\n".join(["t,x,f", *lines]))
    said, shown = str(caught.value), cell.strip('"')
    assert f"column 'f' cannot be read: it holds {shown!r} in line 2, which was taken for" in said
    assert "no column" not in said


def test_a_group_that_links_to_itself_ends(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "loop.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = POSITION
        file["inner/y"] = FORCE
        file["inner/again"] = h5py.SoftLink("/inner")
        file["whole"] = h5py.SoftLink("/")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    assert set(read(path).values) == {"x", "inner.y"}
