"""Fuzz targets of the recording reader, the importer and the descriptions, and their corpus.

Each target is tried for ten minutes by

    RIGTWIN_FUZZ_SECONDS=600 python -m pytest -m slow tests/test_fuzz.py
"""

from __future__ import annotations

import copy
import json
import os
import shutil
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigtwin
from rigtwin.description.catalogue import find, shipped
from rigtwin.description.document import examine_text
from rigtwin.errors import RigtwinError
from rigtwin.importing.text import read_text
from rigtwin.recording import Writer, load
from rigtwin.recording.growing import GrowingRecording

hypothesis = pytest.importorskip("hypothesis")
st = pytest.importorskip("hypothesis.strategies")

SECONDS = float(os.environ.get("RIGTWIN_FUZZ_SECONDS", "0"))
"""Time for which each target is tried; 0 for a few examples, the same in every run."""
CORPUS = Path(__file__).parent / "corpus"
MODELS = Path(__file__).parent.parent / "models" / "xml"
TICKS = 300
FORCE = 50.0 * np.cos(np.arange(TICKS) * 0.03)


def value_or_line(call: Callable[[], Any]) -> Any:
    """Return the value of a call, or None if it is refused; a refusal is one line."""
    try:
        return call()
    except RigtwinError as error:
        line = str(error)
    assert "\n" not in line
    return None


def fuzz(law: Callable[[Any], None], inputs: Any, examples: int) -> None:
    """Try a law on drawn inputs, for SECONDS or as many examples."""
    end = time.monotonic() + SECONDS
    while True:
        settings = hypothesis.settings(
            max_examples=500 if SECONDS else examples,
            derandomize=not SECONDS,
            database=None,
            deadline=None,
            suppress_health_check=list(hypothesis.HealthCheck),
        )
        settings(hypothesis.given(inputs)(law))()
        if time.monotonic() >= end:
            return


# Recordings


def make_recording(path: Path) -> bytes:
    with Writer(path, "e", 1e-3, {}, "damper-bench", {"/sensor": ("force",)}) as writer:
        for start in range(0, TICKS, 100):
            writer.append(sensor=FORCE[start : start + 100, None])
    return path.read_bytes()


def damages(size: int) -> Any:
    """Damages of a file: kind, place, length and a byte."""
    damage = st.tuples(
        st.sampled_from(("flip", "cut", "delete", "insert", "zero", "repeat")),
        st.integers(0, size - 1),
        st.integers(1, 64),
        st.integers(1, 255),
    )
    return st.lists(damage, min_size=1, max_size=4)


def damaged(content: bytes, damages: list[tuple[str, int, int, int]]) -> bytes:
    data = bytearray(content)
    for kind, place, length, byte in damages:
        place = min(place, max(len(data) - 1, 0))
        part = slice(place, place + length)
        if kind == "flip" and data:
            data[place] ^= byte
        elif kind == "cut":
            del data[place:]
        elif kind == "delete":
            del data[part]
        elif kind == "insert":
            data[place:place] = bytes([byte]) * length
        elif kind == "zero":
            data[part] = bytes(len(data[part]))
        elif kind == "repeat":
            data[place:place] = data[part]
    return bytes(data)


@pytest.mark.slow
def test_a_damaged_recording_is_refused_or_read_without_a_wrong_value(tmp_path):
    whole = make_recording(tmp_path / "whole.mcap")
    path = tmp_path / "damaged.mcap"

    def law(drawn: list[tuple[str, int, int, int]]) -> None:
        path.write_bytes(damaged(whole, drawn))
        readers: list[Callable[[], Any]] = [lambda: load(path)]
        growing = GrowingRecording(path, np.inf)
        readers.append(lambda: (growing.read(), growing.recording())[1])
        for read in readers:
            recording = value_or_line(read)
            if recording is None:
                continue
            ticks = np.round(recording.time / 1e-3).astype(int)
            assert np.array_equal(recording["/sensor.force"], FORCE[ticks])

    fuzz(law, damages(len(whole)), 8)


# Imports

numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 4))
tables = st.fixed_dictionaries(
    {
        "values": st.lists(st.tuples(numbers, numbers), min_size=6, max_size=30),
        "separator": st.sampled_from(";\t,| "),
        "decimal": st.sampled_from(".,"),
        "spelling": st.sampled_from(("plain", "fixed", "exponent", "thousands", "other thousands")),
        "quoted": st.booleans(),
        "encoding": st.sampled_from(("utf-8", "utf-8-sig", "utf-16", "latin-1")),
        "end": st.sampled_from(("\n", "\r\n", "\r")),
        "above": st.lists(
            st.sampled_from(("", "Logger 4711", "# a; b", "Prüfling, 3")), max_size=3
        ),
    }
)


def spell(number: float, table: dict[str, Any]) -> str:
    style, decimal = table["spelling"], table["decimal"]
    form = {"plain": repr(number), "fixed": f"{number:.4f}", "exponent": f"{number:.12e}"}
    text = form.get(style, f"{number:,.4f}")
    if style == "thousands" and decimal == ".":
        text = text.replace(",", "'")
    signs = {".": ".", ",": ","} if style == "other thousands" else {".": decimal, ",": "."}
    text = "".join(signs.get(sign, sign) for sign in text)
    return f'"{text}"' if table["quoted"] else text


def as_text(table: dict[str, Any]) -> str:
    separator, end = table["separator"], table["end"]
    rows = [
        separator.join((str(row), *(spell(number, table) for number in pair)))
        for row, pair in enumerate(table["values"])
    ]
    return end.join([*table["above"], separator.join(("t", "u", "v")), *rows, ""])


@pytest.mark.slow
def test_a_table_of_any_dialect_is_refused_or_read_rightly(tmp_path):
    path = tmp_path / "log.csv"

    def law(table: dict[str, Any]) -> None:
        path.write_bytes(as_text(table).encode(table["encoding"]))
        columns = value_or_line(lambda: read_text(path))
        # Where a decimal comma also separates, no reader can tell the columns; a map names them.
        if columns is None or not {"t", "u", "v"} <= set(columns.values):
            return
        assert columns.values["t"].tolist() == list(range(len(table["values"])))
        for name, expected in zip("uv", zip(*table["values"], strict=True), strict=True):
            read = columns.values[name]
            known = np.isfinite(read)
            np.testing.assert_allclose(read[known], np.array(expected)[known], rtol=1e-9, atol=1e-9)

    fuzz(law, tables, 40)


@pytest.mark.slow
def test_a_damaged_file_is_imported_or_refused_in_one_line(tmp_path):
    time_base = np.arange(40) * 1e-3
    text = "t,x,F\n" + "".join(f"{t:.4f},{np.sin(t):.6f},{1e3 * t:.3f}\n" for t in time_base)
    files = {"log.csv": text.encode(), "log.json": json.dumps([{"t": 0.0, "F": 1.0}] * 3).encode()}
    np.savez(tmp_path / "log.npz", t=time_base, F=time_base)
    files["log.npz"] = (tmp_path / "log.npz").read_bytes()
    mapping = {
        "machine": "a",
        "time": {"column": "t", "unit": "s"},
        "channels": {"/sensor.force": {"column": "F", "unit": "N"}},
    }

    def law(drawn: tuple[str, list[tuple[str, int, int, int]]]) -> None:
        name, harm = drawn
        (tmp_path / name).write_bytes(damaged(files[name], harm))
        log = tmp_path / name
        value_or_line(lambda: rigtwin.import_data(log, mapping, tmp_path / "r.mcap"))

    fuzz(law, st.tuples(st.sampled_from(sorted(files)), damages(900)), 20)


# Descriptions

odd_values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text(max_size=30),
    st.sampled_from(("x" * 3000, "\x1b[2J", "../../etc/passwd", "class", "1e400")),
    st.lists(st.integers(0, 3), max_size=3),
    st.dictionaries(st.text(max_size=5), st.integers(0, 3), max_size=2),
)
"""None deletes a key."""


def places(value: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        yield (*above, key)
        if isinstance(inner, dict | list):
            yield from places(inner, (*above, key))


def changed(document: dict[str, Any], place: tuple[Any, ...], value: Any) -> dict[str, Any]:
    document = copy.deepcopy(document)
    inner: Any = document
    for key in place[:-1]:
        inner = inner[key]
    if value is None:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return document


def as_toml(value: Any) -> str:
    """Return a value as TOML, inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{as_toml(str(k))} = {as_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(as_toml, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value).replace("\x7f", "\\u007f")


@pytest.mark.slow
def test_a_changed_description_is_a_machine_or_a_list_of_mistakes(tmp_path):
    for model in MODELS.glob("*.xml"):
        shutil.copy(model, tmp_path)
    # The rig and the large arm take long to compile; their tables are those of the others.
    documents = {
        name: tomllib.loads(path.read_text())
        for name, path in shipped().items()
        if name not in ("suspension-rig", "tx40")
    }
    targets = [(name, place) for name, table in documents.items() for place in places(table)]

    def law(drawn: tuple[tuple[str, tuple[Any, ...]], Any]) -> None:
        (name, place), value = drawn
        document = changed(documents[name], place, value)
        text = "\n".join(f"{as_toml(key)} = {as_toml(table)}" for key, table in document.items())
        machine, mistakes = examine_text(text, tmp_path / "a.toml")
        assert (machine is None) == bool(mistakes)
        assert not any("\n" in mistake for mistake in mistakes)

    fuzz(law, st.tuples(st.sampled_from(targets), odd_values), 15)


# The corpus: what was found once


@pytest.mark.parametrize("path", sorted(CORPUS.glob("importer/*")), ids=lambda path: path.name)
def test_tables_that_were_read_wrongly(path):
    columns = read_text(path)
    wrong = "no end" in " ".join(columns.notes) or "F" in columns.refused or "2" in columns.values
    assert wrong, columns


@pytest.mark.parametrize("path", sorted(CORPUS.glob("description/*")), ids=lambda path: path.name)
def test_descriptions_that_ended_in_a_traceback(path):
    with pytest.raises(RigtwinError) as told:
        find(str(path))
    assert "\n" not in str(told.value)
