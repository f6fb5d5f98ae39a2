"""Data in memory: DataFrames, dictionaries of arrays, arrays with named fields, npz files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.errors import RigtwinError
from rigtwin.importing.frames import read_frame
from rigtwin.importing.selection import EVERYTHING
from rigtwin.importing.table import read

TIME = np.arange(300) * 0.002
ANGLES = np.column_stack([np.sin(8.0 * TIME), np.cos(5.0 * TIME)])
MAP = {
    "machine": "bench",
    "time": {"column": "t"},
    "channels": {
        "/sensor.first": {"column": "q[0]"},
        "/sensor.second": {"column": "q[1]", "unit": "deg"},
    },
}


def test_a_dictionary_of_arrays_becomes_a_recording(tmp_path: Path):
    recording = rigtwin.import_data({"t": TIME, "q": ANGLES}, MAP, tmp_path / "out.mcap")
    np.testing.assert_allclose(recording["/sensor.first"], ANGLES[:, 0])
    np.testing.assert_allclose(recording["/sensor.second"], np.radians(ANGLES[:, 1]))
    assert recording.period == 0.002


def test_a_map_in_memory_is_checked_as_one_in_a_file(tmp_path: Path):
    with pytest.raises(RigtwinError, match="unknown key 'chanels'"):
        rigtwin.import_data({"t": TIME}, {**MAP, "chanels": {}}, tmp_path / "out.mcap")
    with pytest.raises(RigtwinError, match=re.escape("no column 'q[0]'; there are t")):
        rigtwin.import_data({"t": TIME}, MAP, tmp_path / "out.mcap")


def test_a_data_frame_with_lists_dates_and_an_index(tmp_path: Path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"q": list(ANGLES), "note": "calm"})
    frame.index = pandas.Index(
        pandas.Timestamp("2026-11-22T14:03:01") + pandas.to_timedelta(TIME, "s"), name="t"
    )
    recording = rigtwin.import_data(frame, MAP, tmp_path / "out.mcap")
    assert recording.ticks == 300
    assert recording.period == pytest.approx(0.002)
    np.testing.assert_allclose(recording["/sensor.first"], ANGLES[:, 0])


def test_columns_of_a_data_frame_that_are_no_numbers_matter_only_if_needed(tmp_path: Path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(
        np.column_stack([TIME, TIME, ANGLES]), columns=["t", "t", "q[0]", "q[1]"]
    )
    with pytest.raises(RigtwinError, match="column 't' cannot be read: 2 columns are named 't'"):
        rigtwin.import_data(frame, MAP, tmp_path / "out.mcap")
    found = read_frame(frame, EVERYTHING)
    assert set(found.values) == {"q[0]", "q[1]"}
    words = read_frame({"word": ["a", "b"], "ragged": [[1], [2, 3]]}, EVERYTHING)
    assert words.refused["word"] == "it holds text"
    assert "different lengths" in words.refused["ragged"]


def test_an_arrow_table_and_named_fields():
    pyarrow = pytest.importorskip("pyarrow")
    pytest.importorskip("pandas")
    table = pyarrow.table({"t": TIME, "flag": TIME > 0.1})
    np.testing.assert_array_equal(read_frame(table, EVERYTHING).values["flag"], TIME > 0.1)
    fields = np.array([(1.0, 2), (3.0, 4)], [("a", float), ("b", int)])
    np.testing.assert_array_equal(read_frame(fields, EVERYTHING).values["b"], [2.0, 4.0])


def test_dates_out_of_any_range_and_missing_ones():
    days = np.array(["0001-01-01", "9999-12-31", "NaT"], "datetime64[D]")
    found = read_frame({"day": days}, EVERYTHING)
    assert found.values["day"][1] == pytest.approx(253402214400.0)
    assert np.isnan(found.values["day"][2])
    assert found.units["day"] == "s"


def test_a_numpy_archive(tmp_path: Path):
    np.savez(tmp_path / "log.npz", t=TIME, q=ANGLES)
    recording = rigtwin.import_data(tmp_path / "log.npz", MAP, tmp_path / "out.mcap")
    np.testing.assert_allclose(recording["/sensor.first"], ANGLES[:, 0])
    (tmp_path / "odd.npz").write_bytes(b"nothing of the sort")
    with pytest.raises(RigtwinError, match=r"odd\.npz is not an npz file"):
        read(tmp_path / "odd.npz")
    np.savez(tmp_path / "objects.npz", t=np.array([{}, {}]))
    with pytest.raises(RigtwinError, match=r"objects\.npz"):
        read(tmp_path / "objects.npz")


@pytest.mark.parametrize("data", [3, None, [1, 2], "absent.csv"])
def test_anything_else_is_one_line(tmp_path: Path, data: object):
    with pytest.raises(RigtwinError):
        rigtwin.import_data(data, MAP, tmp_path / "out.mcap")  # type: ignore[arg-type]


@pytest.mark.parametrize("machine", [None, "tx40"])
def test_a_table_without_a_model_is_refused_in_one_line(machine: str | None) -> None:
    with pytest.raises(RigtwinError, match=r"^dict: expected a recording.*need a model") as error:
        rigtwin.diagnose({"t": np.arange(9.0)}, machine=machine)
    assert "\n" not in str(error.value)


def test_several_files_are_paths(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    with pytest.raises(RigtwinError, match="dict is no path"):
        rigtwin.describe(tmp_path / "arm.xml", [{"t": np.arange(9.0)}])


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(RigtwinError, match="'q' has 6 rows, and 't' has 9"):
        read_frame({"t": np.arange(9.0), "q": np.arange(6.0)}, EVERYTHING)
