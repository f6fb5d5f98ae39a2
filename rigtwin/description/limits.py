"""Limits of a described machine: what its sensors read and its actuators are told within a test,
beyond which the test is over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigtwin.components.quantity import Quantity
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Component, Machine
from rigtwin.description.mistakes import Mistakes, near
from rigtwin.description.settings import Nothing, group_of
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

LOW, HIGH = "_low", "_high"
"""What a limit's two settings end in, after its component's name."""
UNBOUNDED = 1e12
SOURCE = "the description's limits"
Columns = Mapping[str, Mapping[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


@dataclass(frozen=True)
class Limit:
    """Of one channel. name: of its component; low, high: in its unit."""

    name: str
    low: float
    high: float
    unit: str

    def reach(self, signal: Array) -> float:
        """How far a signal, shape (ticks,), went from the middle of the limits, where 1 is at one
        of them."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return float(np.max(np.abs(signal - middle))) / half

    def nearest(self, signal: Array) -> tuple[float, float]:
        """How far a signal, shape (ticks,), went from the middle of the limits, and how far it
        may."""
        half = 0.5 * (self.high - self.low)
        return self.reach(signal) * half, half


@dataclass(frozen=True)
class Tripped:
    """What ended a test early. tick: of the first value beyond a limit; reason: one line."""

    tick: int
    reason: str


def read_limits(table: object, components: Mapping[str, Component], mistakes: Mistakes) -> Any:
    """The limits as a description's table has them, as a group of settings.

    Parameters
    ----------
    table
        Component → [low, high], or one number for both sides.
    components
        By name.
    mistakes
        Where those of the table are noted.

    Returns
    -------
    tuple
        A NamedTuple, `NAME_low` and `NAME_high` for each component.
    """
    if not isinstance(table, Mapping):
        mistakes.note("[limits]", "expected a table, such as position = [-0.2, 0.2]")
        return Nothing()
    limited = {name: c for name, c in components.items() if c.channel is not None}
    values: dict[str, tuple[float, Quantity]] = {}
    for name, given in table.items():
        where = f"[limits] {name}"
        if name not in limited:
            mistakes.note(where, f"no sensor or actuator of that name; {near(name, limited)}")
            continue
        ends = given if isinstance(given, list) else [given, given]
        if len(ends) != 2:
            mistakes.note(where, f"{str(given)[:40]}: expected [low, high], or a number")
            continue
        before = len(mistakes)
        numbers = [
            mistakes.number(where, end, -UNBOUNDED, UNBOUNDED)
            for end in (ends if isinstance(given, list) else ends[:1])
        ]
        if len(mistakes) > before:
            continue
        low, high = numbers if isinstance(given, list) else (-numbers[0], numbers[0])
        if not low < high:
            expected = "low below high" if isinstance(given, list) else "a number above 0"
            mistakes.note(where, f"{str(given)[:40]}: expected {expected}")
        meaning = Quantity(limited[name].unit or "1", -UNBOUNDED, UNBOUNDED, SOURCE)
        values |= {name + LOW: (low, meaning), name + HIGH: (high, meaning)}
    return group_of(values) if values else Nothing()


def require_order(machine: Machine, configuration: Configuration) -> None:
    """Raises RigtwinError for limits whose low one is not below the high one."""
    told = configuration.safety._asdict()
    for name in machine.components:
        if name + LOW in told and not told[name + LOW] < told[name + HIGH]:
            key, low, high = f"safety.{name}", told[name + LOW], told[name + HIGH]
            raise RigtwinError(f"{key}{LOW} = {low:g}, {key}{HIGH} = {high:g}: expected low below")


def limited_signals(
    machine: Machine, configuration: Configuration, columns: Columns
) -> Iterator[tuple[Limit, Array]]:
    """The limits of a test, each with its signal.

    Parameters
    ----------
    machine
        Its description.
    configuration
        Of the test.
    columns
        Topic → field → signal, shape (ticks,), as recorded.

    Yields
    ------
    tuple
        A limit, and the signal of its channel; none that was not recorded.

    Raises
    ------
    RigtwinError
        As `require_order`.
    """
    require_order(machine, configuration)
    told = configuration.safety._asdict()
    for name, component in machine.components.items():
        if component.channel is None or name + LOW not in told:
            continue
        low, high = told[name + LOW], told[name + HIGH]
        topic, field = component.channel
        if field in columns.get(topic, {}):
            yield Limit(name, low, high, component.unit), columns[topic][field]


def find_trip(machine: Machine, configuration: Configuration, columns: Columns) -> Tripped | None:
    """What ends a test early, if anything does: the first value beyond a limit. Arguments as of
    `limited_signals`."""
    found: list[Tripped] = []
    for limit, signal in limited_signals(machine, configuration, columns):
        for beyond, said in (
            (~np.isfinite(signal), "is not a finite number"),
            (signal > limit.high, f"above {limit.high:g} {limit.unit}".rstrip()),
            (signal < limit.low, f"below {limit.low:g} {limit.unit}".rstrip()),
        ):
            if beyond.any():
                found.append(Tripped(int(np.argmax(beyond)), f"trip: {limit.name} {said}"))
    return min(found, key=lambda trip: trip.tick, default=None)


def largest_reach(machine: Machine, configuration: Configuration, columns: Columns) -> float:
    """The largest share of a limit that a test reached; 0 of a machine without limits. Arguments as
    of `limited_signals`."""
    limited = limited_signals(machine, configuration, columns)
    reached = [limit.reach(signal) for limit, signal in limited]
    return max((each for each in reached if math.isfinite(each)), default=0.0)
