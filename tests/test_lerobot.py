"""LeRobot data sets, v2 and v3, laid out by pyarrow as LeRobot does: episodes become recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.importing.selection import Selection
from rigtwin.importing.table import read

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
JOINTS = ["shoulder_pan.pos", "elbow_flex.pos"]
LENGTHS = (120, 90, 150)
MAP = """
machine = "arm"
[time]
column = "timestamp"
[channels]
"/command.elbow" = { column = "action[elbow_flex.pos]", unit = "deg" }
"/sensor.elbow" = { column = "observation.state[elbow_flex.pos]", unit = "deg" }
"""


def lists(values: np.ndarray, fixed: bool) -> Any:
    flat = pyarrow.array(values.astype(np.float32).ravel())
    count = values.shape[1]
    if fixed:
        return pyarrow.FixedSizeListArray.from_arrays(flat, count)
    return pyarrow.ListArray.from_arrays(np.arange(len(values) + 1) * count, flat)


def episode(number: int, fixed: bool) -> Any:
    rows = LENGTHS[number]
    time = (np.arange(rows) / 50.0).astype(np.float32)
    state = np.column_stack([np.full(rows, float(number)), 30.0 * np.sin(3.0 * time)])
    return pyarrow.table(
        {
            "action": lists(state + 1.0, fixed),
            "observation.state": lists(state, fixed),
            "timestamp": time,
            "frame_index": np.arange(rows),
            "episode_index": np.full(rows, number),
            "task_index": np.zeros(rows, int),
            "next.done": np.arange(rows) == rows - 1,
        }
    )


def dataset(folder: Path, version: str) -> Path:
    """Make a data set; v2 has a file an episode, v3 a file of several."""
    v3 = version.startswith("v3")
    names: Any = JOINTS if v3 else {"motors": JOINTS}
    feature = {"dtype": "float32", "shape": [2], "names": names}
    features = {"action": feature, "observation.state": feature}
    (folder / "meta").mkdir(parents=True)
    information = {"codebase_version": version, "fps": 50, "features": features}
    (folder / "meta" / "info.json").write_text(json.dumps(information))
    chunk = folder / "data" / "chunk-000"
    chunk.mkdir(parents=True)
    tables = [episode(number, fixed=v3) for number in range(len(LENGTHS))]
    if v3:
        parquet.write_table(pyarrow.concat_tables(tables[:2]), chunk / "file-000.parquet")
        parquet.write_table(tables[2], chunk / "file-001.parquet")
    else:
        for number, table in enumerate(tables):
            parquet.write_table(table, chunk / f"episode_{number:06d}.parquet")
    (folder / "map.toml").write_text(MAP)
    return folder


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
def test_every_episode_becomes_a_recording(tmp_path: Path, version: str):
    data = dataset(tmp_path / "data", version)
    recordings = rigtwin.import_episodes(data, data / "map.toml", tmp_path / "out")
    assert [recording.ticks for recording in recordings] == list(LENGTHS)
    names = [recording.path.name for recording in recordings]
    assert names == [f"episode_{number:06d}.mcap" for number in range(3)]
    expected = np.radians(30.0 * np.sin(3.0 * np.arange(150) / 50.0))
    np.testing.assert_allclose(recordings[2]["/sensor.elbow"], expected, atol=1e-6)
    assert recordings[0].period == pytest.approx(0.02)
    assert f"LeRobot data set {version}" in recordings[0].report[0]


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_one_episode_is_chosen_by_the_map(tmp_path: Path, version: str):
    data = dataset(tmp_path / "data", version)
    with pytest.raises(RigtwinError, match=r"holds 3 episodes; name a folder .* take = \[0\]"):
        rigtwin.import_data(data, data / "map.toml", tmp_path / "one.mcap")
    (data / "map.toml").write_text(MAP + "[episodes]\ntake = [1]\n")
    recording = rigtwin.import_data(data, data / "map.toml", tmp_path / "one.mcap")
    assert recording.ticks == LENGTHS[1]
    (data / "map.toml").write_text(MAP + "[episodes]\ntake = [7]\n")
    with pytest.raises(RigtwinError, match="no episode 7; 'episode_index' has 3, from 0 to 2"):
        rigtwin.import_data(data, data / "map.toml", tmp_path / "one.mcap")


def test_the_command_writes_a_folder_and_says_so_of_each_episode(tmp_path: Path, capsys):
    data = dataset(tmp_path / "data", "v3.0")
    out = f"{tmp_path / 'episodes'}/"
    assert main(["import", str(data), "--map", str(data / "map.toml"), "-o", out]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum("LeRobot data set" in line for line in lines) == 1
    assert sum(line.startswith("episode 1: ") for line in lines) >= 1
    assert len(list((tmp_path / "episodes").glob("*.mcap"))) == 3


def test_an_episode_that_cannot_be_read_is_left_out_and_named(tmp_path: Path):
    data = dataset(tmp_path / "data", "v2.1")
    broken = episode(1, fixed=False)
    gap = np.asarray(broken["timestamp"]) + np.where(np.arange(LENGTHS[1]) > 40, 0.5, 0.0)
    place = broken.column_names.index("timestamp")
    broken = broken.set_column(place, "timestamp", pyarrow.array(gap.astype(np.float32)))
    parquet.write_table(broken, data / "data" / "chunk-000" / "episode_000001.parquet")
    recordings = rigtwin.import_episodes(data, data / "map.toml", tmp_path / "out")
    assert [recording.ticks for recording in recordings] == [LENGTHS[0], LENGTHS[2]]
    assert any(
        "episode 1 is left out" in line and "gaps in time" in line for line in recordings[0].report
    )


def test_only_the_mapped_columns_are_read(tmp_path: Path):
    data = dataset(tmp_path / "data", "v3.0")
    columns = read(data, Selection(frozenset({"action[elbow_flex.pos]"})))
    assert set(columns.values) == {"action[elbow_flex.pos]", "episode_index"}
    assert "observation.state" in columns.names


def test_a_csv_whose_rows_name_their_test_is_split_too(tmp_path: Path):
    rows = [f"{run},{0.01 * n},{np.sin(n)}" for run in (3, 8) for n in range(50)]
    (tmp_path / "log.csv").write_text("run,t,x\n" + "\n".join(rows))
    mapping = {
        "machine": "arm",
        "time": {"column": "t"},
        "episodes": {"column": "run"},
        "channels": {"/sensor.x": {"column": "x"}},
    }
    recordings = rigtwin.import_episodes(tmp_path / "log.csv", mapping, tmp_path / "out")
    names = [recording.path.name for recording in recordings]
    assert names == ["episode_000003.mcap", "episode_000008.mcap"]


def test_a_folder_of_another_kind_says_what_was_expected(tmp_path: Path):
    with pytest.raises(RigtwinError, match="a folder of an unknown kind; expected LeRobot data"):
        read(tmp_path)
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text("[]")
    with pytest.raises(RigtwinError, match="expected"):
        read(tmp_path)
