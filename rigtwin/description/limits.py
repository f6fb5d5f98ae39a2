"""Limits of a described machine: ranges of its measurements and commands. A test ends at the first
value outside of its range."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigtwin.components.quantity import Quantity
from rigtwin.description.component import Component
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.mistakes import Mistakes, suggest
from rigtwin.description.settings import Nothing, group_of
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

LOW, HIGH = "_low", "_high"
"""Suffixes of a limit's two settings; the component's name precedes them."""
UNBOUNDED = 1e12
"""Largest magnitude of a limit, in the channel's unit."""
SOURCE = "the description's limits"
"""Source of a limit's value, as listings of settings show it."""
Columns = Mapping[str, Mapping[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


@dataclass(frozen=True)
class Limit:
    """Range of one channel.

    Attributes
    ----------
    name
        Name of the component.
    low, high
        Ends of the range, in the channel's unit.
    unit
        Unit of the channel.
    """

    name: str
    low: float
    high: float
    unit: str

    def reach(self, signal: Array) -> float:
        """Return the largest excursion of a signal, shape (ticks,), from the middle of the range.

        The excursion is a share of half the range, so that 1 means a value at a limit.
        """
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return float(np.max(np.abs(signal - middle))) / half

    def nearest(self, signal: Array) -> tuple[float, float]:
        """Return the largest excursion of a signal, shape (ticks,), and the largest allowed one.

        Both are measured from the middle of the range, in the channel's unit.
        """
        half = 0.5 * (self.high - self.low)
        return self.reach(signal) * half, half


@dataclass(frozen=True)
class LimitTrip:
    """Early end of a test by a limit.

    Attributes
    ----------
    tick
        Tick of the first value beyond the limit.
    reason
        Limit and value, in one line.
    """

    tick: int
    reason: str


def read_limits(table: object, components: Mapping[str, Component], mistakes: Mistakes) -> Any:
    """Return the limits of a description as a group of settings.

    Parameters
    ----------
    table
        Component → [low, high], or one positive number for both sides.
    components
        Components by name.
    mistakes
        List to which mistakes in the table are added.

    Returns
    -------
    tuple
        NamedTuple with the fields `NAME_low` and `NAME_high` of every limited component.
    """
    if not isinstance(table, Mapping):
        mistakes.note("[limits]", "expected a table, such as position = [-0.2, 0.2]")
        return Nothing()
    limited = {name: c for name, c in components.items() if c.channel is not None}
    values: dict[str, tuple[float, Quantity]] = {}
    for name, entry in table.items():
        where = f"[limits] {name}"
        if name not in limited:
            mistakes.note(where, f"no sensor or actuator of that name; {suggest(name, limited)}")
            continue
        ends = entry if isinstance(entry, list) else [entry, entry]
        if len(ends) != 2:
            mistakes.note(where, f"{str(entry)[:40]}: expected [low, high], or a number")
            continue
        # A single number is checked once, so that a mistake in it is noted once.
        before = len(mistakes)
        numbers = [
            mistakes.number(where, end, -UNBOUNDED, UNBOUNDED)
            for end in (ends if isinstance(entry, list) else ends[:1])
        ]
        if len(mistakes) > before:
            continue
        low, high = numbers if isinstance(entry, list) else (-numbers[0], numbers[0])
        if not low < high:
            expected = "low below high" if isinstance(entry, list) else "a number above 0"
            mistakes.note(where, f"{str(entry)[:40]}: expected {expected}")
        meaning = Quantity(limited[name].unit or "1", -UNBOUNDED, UNBOUNDED, SOURCE)
        values |= {name + LOW: (low, meaning), name + HIGH: (high, meaning)}
    return group_of(values) if values else Nothing()


def require_order(machine: Machine, configuration: Configuration) -> None:
    """Raise RigtwinError for a range whose low end is not below its high end.

    The ends are separate settings, so that a change of one can cross the other.
    """
    settings = configuration.safety._asdict()
    for name in machine.components:
        if name + LOW in settings and not settings[name + LOW] < settings[name + HIGH]:
            key, low, high = f"safety.{name}", settings[name + LOW], settings[name + HIGH]
            raise RigtwinError(f"{key}{LOW} = {low:g}, {key}{HIGH} = {high:g}: expected low below")


def limited_signals(
    machine: Machine, configuration: Configuration, columns: Columns
) -> Iterator[tuple[Limit, Array]]:
    """Yield the limits of a test with the limited signals.

    Parameters
    ----------
    machine
        Machine under test.
    configuration
        Configuration of the test; its safety settings are the limits.
    columns
        Topic → field → recorded signal, shape (ticks,).

    Yields
    ------
    tuple
        Limit, and the signal of its channel. Channels that were not recorded are left out.

    Raises
    ------
    RigtwinError
        If a limit's low end is not below its high end.
    """
    require_order(machine, configuration)
    settings = configuration.safety._asdict()
    for name, component in machine.components.items():
        if component.channel is None or name + LOW not in settings:
            continue
        low, high = settings[name + LOW], settings[name + HIGH]
        topic, field = component.channel
        if field in columns.get(topic, {}):
            yield Limit(name, low, high, component.unit), columns[topic][field]


def find_trip(machine: Machine, configuration: Configuration, columns: Columns) -> LimitTrip | None:
    """Return the first violation of a limit in a test, or None without one.

    The arguments are those of `limited_signals`.
    """
    trips: list[LimitTrip] = []
    for limit, signal in limited_signals(machine, configuration, columns):
        # Comparisons with NaN are false, so a value that is not finite needs its own check.
        for beyond, violation in (
            (~np.isfinite(signal), "is not a finite number"),
            (signal > limit.high, f"above {limit.high:g} {limit.unit}".rstrip()),
            (signal < limit.low, f"below {limit.low:g} {limit.unit}".rstrip()),
        ):
            if beyond.any():
                # argmax of booleans is the first that is true.
                trips.append(LimitTrip(int(np.argmax(beyond)), f"trip: {limit.name} {violation}"))
    # Of limits that are passed at the same tick, the first of the description counts.
    return min(trips, key=lambda trip: trip.tick, default=None)


def largest_reach(machine: Machine, configuration: Configuration, columns: Columns) -> float:
    """Return the largest share of a limit that a test reached; 0 for a machine without limits.

    The arguments are those of `limited_signals`.
    """
    limited = limited_signals(machine, configuration, columns)
    shares = [limit.reach(signal) for limit, signal in limited]
    # A diverged or missing sample has no share; `find_trip` reports it.
    return max((share for share in shares if math.isfinite(share)), default=0.0)
