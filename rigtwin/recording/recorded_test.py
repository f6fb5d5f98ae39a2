"""A recorded test as it is read from a file."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mcap.exceptions import InvalidMagic
from mcap.records import Metadata

from rigtwin.errors import RigtwinError
from rigtwin.files import printable
from rigtwin.numerics.arrays import Array
from rigtwin.recording.checksum import unseal
from rigtwin.recording.inputs import Inputs
from rigtwin.recording.records import read_records
from rigtwin.recording.schema import (
    TRANSITION_RECORD,
)

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class RecordedTest:
    """Recording of one test.

    Parameters
    ----------
    path : Path
        Path of the file.
    machine, experiment : str
        Names of the machine and of the experiment.
    period : float
        Period of a tick, in s.
    time : Array
        Time since the start in s, shape (ticks,).
    columns : mapping
        Topic → field → values in SI units, shape (ticks,). All topics have the same ticks.
    controller : mapping
        The operator's settings of the controller; empty if they were not recorded.
    twin : mapping
        Origin of a twin's recording; empty for a rig.
    end : str
        Reason for the end of the test.
    notes : tuple of str
        Defects of the file, in words.
    transitions : tuple of mapping
        Transitions of a supervised session in order.
    lateness : mapping
        Lateness of a loop in real time.
    description : Path or None
        Description of the machine, where the recording remembers one; the file may be gone.
    """

    path: Path
    machine: str
    experiment: str
    period: float
    time: Array
    columns: Mapping[str, Mapping[str, Array]]
    controller: Mapping[str, object]
    twin: Mapping[str, str] = field(default_factory=dict)
    end: str = ""
    notes: tuple[str, ...] = ()
    transitions: tuple[Mapping[str, str], ...] = ()
    lateness: Mapping[str, str] = field(default_factory=dict)
    description: Path | None = None

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.time)

    def __getitem__(self, channel: str) -> Array:
        """Return one channel by `/topic.field`, such as `/sensor.load_cell`.

        Raises RigtwinError if the recording lacks it.
        """
        if not isinstance(channel, str):
            raise RigtwinError(f"{channel!r:.60}: expected a channel such as '/sensor.load_cell'")
        topic, _, name = channel.partition(".")
        return self.column(topic, name)

    @property
    def channels(self) -> tuple[str, ...]:
        """All channels as `/topic.field`."""
        return tuple(f"{topic}.{name}" for topic, names in self.columns.items() for name in names)

    def between(self, start: float, stop: float) -> RecordedTest:
        """Return the ticks from a time on and before another, in s."""
        # Half a period of tolerance, because recorded times are rounded.
        first, last = np.searchsorted(self.time, np.array([start, stop]) - 0.5 * self.period)
        if first == 0 and last == self.ticks:
            return self
        columns = {
            topic: {n: np.ascontiguousarray(values[first:last]) for n, values in names.items()}
            for topic, names in self.columns.items()
        }
        return replace(self, time=np.ascontiguousarray(self.time[first:last]), columns=columns)

    def to_pandas(self) -> pandas.DataFrame:
        """Return all channels as a table, one column per channel, indexed by time in s.

        Raises
        ------
        RigtwinError
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise RigtwinError("tables need pandas: pip install 'rigtwin[pandas]'") from None
        return pandas.DataFrame(
            {name: self[name] for name in self.channels}, index=pandas.Index(self.time, name="time")
        )

    @property
    def inputs(self) -> Inputs:
        """The signals and controller settings alone, as models take them."""
        return Inputs(str(self.path), self.period, self.columns, self.controller)

    def has(self, topic: str, name: str) -> bool:
        """Return whether a channel exists."""
        return self.inputs.has(topic, name)

    def column(self, topic: str, name: str) -> Array:
        """Return one channel, shape (ticks,).

        Raises
        ------
        RigtwinError
            If the channel is missing; the message lists those that exist.
        """
        return self.inputs.column(topic, name)


def transitions(path: Path) -> tuple[Mapping[str, str], ...]:
    """Read the transitions of a supervised session, even if it ended before its test began.

    Parameters
    ----------
    path : Path
        Path of the recording.

    Returns
    -------
    tuple of mapping
        Transitions that can be read, in order of time.

    Raises
    ------
    RigtwinError
        If the file cannot be read at all.
    """
    # Only metadata are needed, so messages are not decoded and a file without ticks is no error.
    states: list[Mapping[str, str]] = []
    try:
        with path.open("rb") as file:
            for record in read_records(file):
                if isinstance(record, Metadata) and record.name == TRANSITION_RECORD:
                    values, _ = unseal(record.metadata)
                    states += [values] if values not in states else []
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    # A file that is no recording has no transitions; `load` is what complains about it.
    except (InvalidMagic, struct.error):
        pass
    return sort_transitions(states)


def sort_transitions(transitions: list[Mapping[str, str]]) -> tuple[Mapping[str, str], ...]:
    """Return transitions by time; on a full disk the last are in space reserved at the start."""
    # Sorting is stable: transitions at one time keep the order in which they were written.
    return tuple(sorted(map(printable_values, transitions), key=_moment))


def printable_values(values: Mapping[str, str]) -> dict[str, str]:
    """Return metadata that cannot control a terminal."""
    return {printable(name): printable(value) for name, value in values.items()}


def _moment(transition: Mapping[str, str]) -> float:
    """Return the time of a transition in s; infinite if it cannot be read."""
    try:
        return float(transition.get("time", ""))
    # At the end: a time that cannot be read must not move the known transitions.
    except ValueError:
        return math.inf
