"""A map from a file's columns to a recording's channels, one TOML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from controllers.formula import Formula
from rigtwin.importing.selection import Selection


@dataclass(frozen=True)
class Column:
    """Column of the file.

    Parameters
    ----------
    name
        Name of the column.
    unit
        Unit of its numbers; None for the unit that the file states.
    wrap
        Range of a counter after which it begins again, counts; None for any other column.
    """

    name: str
    unit: str | None
    wrap: float | None


@dataclass(frozen=True)
class Source:
    """Source of a channel's values: a column, a formula of columns in SI, or a constant.

    The values of a column are sign · scale · column + offset, with the column in SI.
    """

    column: Column | None = None
    scale: float = 1.0
    offset: float = 0.0
    sign: float = 1.0
    constant: float | None = None
    formula: Formula | None = None


@dataclass(frozen=True)
class Map:
    """Columns of a file, and the channels that they become.

    Parameters
    ----------
    machine
        Name of the machine, or the path of its description as the map spells it.
    experiment
        Name of the test.
    time
        Columns whose sum is the time, such as a date and a time of day.
    time_unit
        Unit of these columns. None for the unit that the file states.
    period
        Period of the rows, s. None if columns hold the time.
    resample
        Period to resample to, s. None keeps the rows.
    start, until
        Stretch of the data to import, s.
    columns
        Name in formulas → column.
    channels
        (Topic, field) → source of the channel.
    controller
        Settings of the controller in this test.
    episode
        Column that numbers the episodes. None for the one that the file states.
    episodes
        Numbers of the episodes to import. Empty for all.
    folder
        Folder in which a relative path of a description is looked for.
    """

    machine: str
    experiment: str
    time: tuple[str, ...]
    time_unit: str | None
    period: float | None
    resample: float | None
    start: float
    until: float
    columns: Mapping[str, Column]
    channels: Mapping[tuple[str, str], Source]
    controller: Mapping[str, float | str]
    episode: str | None = None
    episodes: tuple[int, ...] = ()
    folder: Path = Path()

    @property
    def inputs(self) -> dict[str, Column]:
        """Columns to read: by the channel's name, and by their name in formulas."""
        inputs: dict[str, Column] = {}
        for channel, source in self.channels.items():
            if source.column is not None:
                inputs[".".join(channel)] = source.column
            for name in source.formula.inputs if source.formula is not None else ():
                inputs[name] = self.columns.get(name, Column(name, None, None))
        return inputs

    @property
    def selection(self) -> Selection:
        """Columns and episodes that the map needs of a file."""
        names = {column.name for column in self.inputs.values()} | {*self.time}
        return Selection(
            frozenset(names | ({self.episode} if self.episode else set())), self.time, self.episodes
        )
