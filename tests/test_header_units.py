"""Units on a line of their own, below the names of a text file's columns."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigtwin.importing.text import read_text

ROWS = "\n".join(f"{n};{n}.5;{n}.25;{n}" for n in range(20))


@pytest.mark.parametrize(
    "units",
    ["[ms];[mm];[N];[°C]", "ms;mm;N;degC", "(ms);(mm);(N);", "ms;mm;N;-"],
)
def test_the_line_below_the_names_states_units(tmp_path: Path, units: str) -> None:
    """Brackets, empty cells and units that have no place here do not matter."""
    (tmp_path / "log.csv").write_text(f"Time;ActPos;ActForce;Temp\n{units}\n{ROWS}\n")
    columns = read_text(tmp_path / "log.csv")
    assert list(columns.values) == ["Time", "ActPos", "ActForce", "Temp"]
    assert [columns.units[name] for name in ("Time", "ActPos", "ActForce")] == ["ms", "mm", "N"]


def test_names_below_a_title_are_names(tmp_path: Path) -> None:
    """A line above the names that names groups of columns is no line of names."""
    (tmp_path / "log.csv").write_text(f"Axis;;Drive;\ntime;pos;force;temp\n{ROWS}\n")
    assert list(read_text(tmp_path / "log.csv").values) == ["time", "pos", "force", "temp"]
