"""A recording remembers its machine's description, and says so when that is gone."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.description.catalogue import SHIPPED
from rigtwin.errors import RigtwinError
from rigtwin.recording.description_path import description_of, description_values

MAP = """
machine = "MACHINE"
[time]
column = "t"
[channels]
"/sensor.displacement" = { column = "x" }
"/sensor.force" = { column = "f" }
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with a description of one's own, a map, and data."""
    folder = tmp_path / "project"
    folder.mkdir()
    text = (SHIPPED / "damper_bench.toml").read_text()
    (folder / "mine.toml").write_text(text.replace('"damper-bench"', '"my-damper"'))
    time = np.arange(400) * 0.002
    rows = np.column_stack([time, 0.01 * np.sin(9 * time), 0.3 * np.cos(9 * time)])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="t,x,f", comments="")
    (folder / "map.toml").write_text(MAP.replace("MACHINE", "mine.toml"))
    return folder


def test_a_map_may_name_the_description_and_the_recording_finds_it(project: Path):
    rigtwin.import_data(project / "log.csv", project / "map.toml", project / "log.mcap")
    recording = rigtwin.load(project / "log.mcap")
    assert recording.machine == "my-damper"
    assert recording.description == project / "mine.toml"
    assert "load_cell" in str(rigtwin.compare(recording))


def test_a_project_that_is_moved_as_a_whole_keeps_its_description(project: Path):
    rigtwin.import_data(project / "log.csv", project / "map.toml", project / "log.mcap")
    moved = project.rename(project.parent / "elsewhere")
    assert rigtwin.load(moved / "log.mcap").units["/sensor.force"] == "N"


def test_a_description_that_is_gone_is_one_line(project: Path, capsys):
    rigtwin.import_data(project / "log.csv", project / "map.toml", project / "log.mcap")
    (project / "mine.toml").rename(project / "other.toml")
    log = str(project / "log.mcap")
    assert main(["compare", log]) == 1
    error = capsys.readouterr().err
    assert f"its description {project / 'mine.toml'} does not exist any more" in error
    assert error.count("\n") == 1
    assert main(["compare", log, "--machine", str(project / "other.toml")]) == 0


def test_a_description_of_another_machine_in_its_place_is_refused(project: Path):
    rigtwin.import_data(project / "log.csv", project / "map.toml", project / "log.mcap")
    shutil.copy(SHIPPED / "damper_bench.toml", project / "mine.toml")
    with pytest.raises(RigtwinError, match=r"describes 'damper-bench'; give its description"):
        rigtwin.compare(project / "log.mcap")


def test_the_command_takes_a_machine_and_the_recording_remembers_it(project: Path):
    (project / "map.toml").write_text(MAP.replace("MACHINE", "whatever"))
    log = str(project / "log.csv")
    arguments = ["import", log, "--map", str(project / "map.toml"), "-o", str(project / "x.mcap")]
    assert main([*arguments, "--machine", str(project / "mine.toml")]) == 0
    assert main(["compare", str(project / "x.mcap")]) == 0


def test_a_test_on_the_twin_of_ones_own_machine_remembers_it_too(project: Path):
    def demands(configuration, seed):
        return {"displacement": 0.01 * np.sin(np.arange(configuration.ticks) * 0.01)}

    mine, path = rigtwin.machine(project / "mine.toml"), project / "run.mcap"
    rigtwin.run(mine, demands, settings={"timing": {"duration": 1.0}}, path=path)
    assert rigtwin.load(path).description == project / "mine.toml"
    shipped = rigtwin.machine("damper-bench")
    rigtwin.run(shipped, demands, settings={"timing": {"duration": 1.0}}, path=path)
    assert rigtwin.load(path).description is None


@pytest.mark.parametrize(
    ("recording", "description", "stored"),
    [
        ("p/log.mcap", "p/arm.toml", "arm.toml"),
        ("p/data/log.mcap", "p/arm.toml", "../arm.toml"),
        ("p/log.mcap", "p/machines/arm.toml", "machines/arm.toml"),
        ("a/b/c/log.mcap", "d/arm.toml", None),
    ],
)
def test_a_path_is_relative_within_a_project_and_absolute_beyond(
    tmp_path: Path, recording: str, description: str, stored: str | None
):
    target = tmp_path / description
    values = description_values(tmp_path / recording, target)
    assert values == {"description": stored or target.as_posix()}
    assert description_of(tmp_path / recording, values) == target


def test_what_is_no_path_is_none(tmp_path: Path):
    assert description_of(tmp_path / "log.mcap", {}) is None
    assert description_of(tmp_path / "log.mcap", {"description": "a\0b"}) is None
    assert description_values(tmp_path / "log.mcap", None) == {}
