"""Measures defined by a study: a statistic of a formula of recorded channels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from controllers.formula import formula
from rigtwin.description.control import Channel
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.models.demands import demanded_channels
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import rms
from rigtwin.studies.tuning.measures import Measure, Trial

TIME = "time"


def _deviation(signal: Array) -> float:
    """Return the standard deviation."""
    return float(np.std(signal))


def _mean(signal: Array) -> float:
    """Return the mean."""
    return float(np.mean(signal))


def _peak(signal: Array) -> float:
    """Return the largest magnitude."""
    return float(np.max(np.abs(signal)))


STATISTICS: dict[str, Callable[[Array], float]] = {
    "rms": rms,
    "deviation": _deviation,
    "mean": _mean,
    "peak": _peak,
}
"""Statistics of a formula's values over a test, by name."""


@dataclass(frozen=True)
class FormulaFigure:
    """Statistic of a formula over a test.

    Attributes
    ----------
    text
        The formula.
    statistic
        Name in `STATISTICS`.
    channels
        Channels of the formula's inputs, in order.
    """

    text: str
    statistic: str
    channels: tuple[Channel, ...]

    def __call__(self, trial: Trial) -> float:
        """Return the figure of a test; NaN if it is not finite."""
        ticks = len(next(iter(next(iter(trial.columns.values())).values())))
        time = np.arange(ticks) * trial.period
        inputs = [
            time if channel == ("", TIME) else trial.columns[channel[0]][channel[1]]
            for channel in self.channels
        ]
        # A formula without inputs still needs a signal of the test's length.
        values = formula(self.text, {}).replayed({}, inputs or [time], trial.period)
        figure = STATISTICS[self.statistic](values[trial.first :])
        # An overflow counts like a trip: the candidate gets no score.
        return figure if math.isfinite(figure) else math.nan


LONGEST = 100
"""Maximum number of characters of a title."""


def list_channels(machine: Machine) -> dict[str, Channel]:
    """Return the channels that formulas can use, by name.

    A name is that of a component with a channel, the field of a channel, or `time`.
    """
    # Of equal names the later entry wins: component, then sensor's field, then demand's field.
    channels = [c.channel for c in machine.components.values() if c.channel is not None]
    control = () if machine.control is None else machine.control.channels
    by_field = {channel[1]: channel for channel in (*control, *demanded_channels(machine))}
    by_field |= {channel[1]: channel for channel in channels}
    by_name = {n: c.channel for n, c in machine.components.items() if c.channel is not None}
    return {TIME: ("", TIME), **by_field, **by_name}


def parse_measure(name: str, table: object, channels: Mapping[str, Channel]) -> Measure:
    """Parse a measure that a study defines.

    Parameters
    ----------
    name
        Name of the measure.
    table
        TOML table of the measure.
    channels
        Channels by their names in formulas.

    Raises
    ------
    RigtwinError
        If an entry is wrong; the message names it and what was expected.
    """
    where = f"measures.{name}"
    if not isinstance(table, Mapping):
        raise RigtwinError(f'{where}: expected a table with formula = "..."')
    known = ("formula", "of", "unit", "title", "more")
    for key in table:
        if key not in known:
            raise RigtwinError(f"{where}: unknown {key!r}; expected {', '.join(known)}")
    text, statistic, more = table.get("formula"), table.get("of", "rms"), table.get("more", False)
    words: dict[str, Any] = {"unit": table.get("unit", "1"), "title": table.get("title", name)}
    for key, value in (("formula", text), *words.items()):
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise RigtwinError(f"{where}.{key} = {value!r:.60}: expected text of one line")
    # matplotlib would typeset text between two $ as a formula.
    if len(words["title"]) > LONGEST or "$" in words["title"]:
        raise RigtwinError(
            f"{where}.title = {words['title']!r:.60}: expected at most {LONGEST} characters, no $"
        )
    if not isinstance(statistic, str) or statistic not in STATISTICS:
        raise RigtwinError(f"{where}.of = {statistic!r:.40}: expected {', '.join(STATISTICS)}")
    if not isinstance(more, bool):
        raise RigtwinError(f"{where}.more = {more!r:.40}: expected true or false")
    try:
        inputs = formula(str(text), {}).inputs
    except ValueError as error:
        raise RigtwinError(f"{where}.formula: {error}") from None
    for channel in inputs:
        if channel not in channels:
            expected = ", ".join(channels)
            raise RigtwinError(f"{where}.formula: unknown {channel!r}; expected {expected}")
    if not inputs:
        raise RigtwinError(f"{where}.formula = {text!r:.60}: expected at least one channel")
    figure = FormulaFigure(
        str(text), str(statistic), tuple(channels[channel] for channel in inputs)
    )
    return Measure(name, words["title"], words["unit"], figure, more)
