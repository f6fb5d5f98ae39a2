"""Parquet columns of every type: numbers where the meaning is clear, one line where it is not."""

from __future__ import annotations

from datetime import date, datetime, timedelta
from datetime import time as clock
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigtwin.errors import RigtwinError
from rigtwin.importing.convert import convert
from rigtwin.importing.selection import Selection
from rigtwin.importing.table import read

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def written(folder: Path, columns: dict[str, Any]) -> Path:
    parquet.write_table(pyarrow.table(columns), folder / "log.parquet")
    return folder / "log.parquet"


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ([True, False, None], [1.0, 0.0, np.nan]),
        ([Decimal("1.25"), Decimal("-3.00"), None], [1.25, -3.0, np.nan]),
        ([timedelta(milliseconds=2), timedelta(days=1), None], [0.002, 86400.0, np.nan]),
        ([clock(1, 2, 3), clock(0), None], [3723.0, 0.0, np.nan]),
        ([date(1970, 1, 3), date(1969, 12, 31), None], [172800.0, -86400.0, np.nan]),
        ([datetime(1970, 1, 1, 0, 1), None, datetime(9999, 12, 31)], [60.0, np.nan, 253402214400]),
        (["1.5", "2", None], [1.5, 2.0, np.nan]),
        ([2**63, 1, None], [2.0**63, 1.0, np.nan]),
        ([float("inf"), 1.0, None], [np.nan, 1.0, np.nan]),
    ],
    ids=["bool", "decimal", "duration", "time", "date", "stamp", "text", "large", "infinite"],
)
def test_columns_of_clear_meaning_are_numbers(tmp_path: Path, column: list, expected: list):
    kind = pyarrow.uint64() if 2**63 in column else None
    found = read(written(tmp_path, {"x": pyarrow.array(column, kind)}))
    np.testing.assert_allclose(found.values["x"], expected)


def test_coded_columns_structures_and_lists_are_taken_apart(tmp_path: Path):
    path = written(
        tmp_path,
        {
            "code": pyarrow.array([3.0, 3.0, 5.0]).dictionary_encode(),
            "motor": pyarrow.array([{"u": 1.0, "i": 2}, {"u": 3.0, "i": 4}, None]),
            "q": pyarrow.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
            "deep": pyarrow.array([[[1, 2], [3, 4]]] * 3),
            "fixed": pyarrow.array([[1, 2]] * 3, pyarrow.list_(pyarrow.int16(), 2)),
            "points": pyarrow.array([[{"x": 1.0}, {"x": 2.0}]] * 3),
        },
    )
    values = read(path).values
    np.testing.assert_array_equal(values["code"], [3.0, 3.0, 5.0])
    np.testing.assert_array_equal(values["motor.u"], [1.0, 3.0, np.nan])
    np.testing.assert_array_equal(values["q[1]"], [2.0, 4.0, 6.0])
    np.testing.assert_array_equal(values["deep[1][0]"], [3.0] * 3)
    np.testing.assert_array_equal(values["fixed[0]"], [1.0] * 3)
    np.testing.assert_array_equal(values["points[1].x"], [2.0] * 3)


@pytest.mark.parametrize(
    ("column", "said"),
    [
        (["calm", "wild", "calm"], "it holds text"),
        ([[1.0], [1.0, 2.0], []], "lists of 0 to 2 values; expected one length"),
        ([[1.0], None, [2.0]], "it holds no list in row 2"),
        ([[0.0] * 5000] * 3, "lists of 5000 values; expected at most 1024"),
        ([b"a", b"b", b"c"], "it holds binary, which is not numeric"),
        ([None, None, None], "it holds null, which is not numeric"),
    ],
    ids=["words", "ragged", "missing", "picture", "binary", "null"],
)
def test_a_column_without_clear_meaning_is_an_error_only_if_needed(
    tmp_path: Path, column: list, said: str
):
    path = written(tmp_path, {"t": [0.0, 0.1, 0.2], "x": [1.0, 2.0, 3.0], "odd": column})
    head = 'machine = "bench"\n[time]\ncolumn = "t"\n[channels]\n"/sensor.x" = '
    (tmp_path / "map.toml").write_text(head + '{ column = "x" }')
    convert([path], tmp_path / "map.toml", tmp_path / "out.mcap")
    (tmp_path / "map.toml").write_text(head + '{ column = "odd" }')
    with pytest.raises(RigtwinError) as caught:
        convert([path], tmp_path / "map.toml", tmp_path / "out.mcap")
    assert said in str(caught.value)
    assert "column 'odd' cannot be read" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "odd" in read(path).refused


def test_names_that_stand_twice(tmp_path: Path):
    table = pyarrow.Table.from_arrays([pyarrow.array([1.0, 2.0])] * 3, names=["x", "y", "x"])
    parquet.write_table(table, tmp_path / "log.parquet")
    found = read(tmp_path / "log.parquet")
    assert list(found.values) == ["y"]
    assert found.refused == {"x": "2 columns are named 'x'"}


def test_only_the_needed_columns_are_read(tmp_path: Path):
    path = written(tmp_path, {"t": [0.0, 1.0], "a.b": [[1.0], [2.0]], "other": [5, 6]})
    found = read(path, Selection(frozenset({"t", "a.b[0]"})))
    assert set(found.values) == {"t", "a.b[0]"}
    assert set(found.names) == {"t", "a.b[0]", "other"}


def test_an_empty_file_and_a_damaged_one_are_one_line(tmp_path: Path):
    path = written(tmp_path, {"q": pyarrow.array([], pyarrow.list_(pyarrow.float64()))})
    with pytest.raises(RigtwinError, match=r"no column of numbers; column 'q': it holds no rows"):
        read(path)
    path = written(tmp_path, {"x": np.arange(50_000.0)})
    data = bytearray(path.read_bytes())
    data[2000:3000] = b"\xff" * 1000
    path.write_bytes(data)
    with pytest.raises(RigtwinError, match=r"log\.parquet is damaged"):
        read(path)
