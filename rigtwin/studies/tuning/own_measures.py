"""Measures that a study defines: a formula of what a test records, and what is made of it."""

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
    return float(np.std(signal))


def _mean(signal: Array) -> float:
    return float(np.mean(signal))


def _peak(signal: Array) -> float:
    return float(np.max(np.abs(signal)))


STATISTICS: dict[str, Callable[[Array], float]] = {
    "rms": rms,
    "deviation": _deviation,
    "mean": _mean,
    "peak": _peak,
}
"""What can be made of a formula's values over a test."""


@dataclass(frozen=True)
class FormulaFigure:
    """text: the formula; statistic: of `STATISTICS`; channels: what its inputs are, in order."""

    text: str
    statistic: str
    channels: tuple[Channel, ...]

    def __call__(self, trial: Trial) -> float:
        """The figure of a test."""
        ticks = len(next(iter(next(iter(trial.columns.values())).values())))
        time = np.arange(ticks) * trial.period
        inputs = [
            time if channel == ("", TIME) else trial.columns[channel[0]][channel[1]]
            for channel in self.channels
        ]
        values = formula(self.text, {}).replayed({}, inputs or [time], trial.period)
        found = STATISTICS[self.statistic](values[trial.first :])
        return found if math.isfinite(found) else math.nan


LONGEST = 100
"""Letters of a title."""


def list_channels(machine: Machine) -> dict[str, Channel]:
    """Name in a formula → channel: components with one, fields of channels, and time."""
    channels = [c.channel for c in machine.components.values() if c.channel is not None]
    control = () if machine.control is None else machine.control.channels
    by_field = {channel[1]: channel for channel in (*control, *demanded_channels(machine))}
    by_field |= {channel[1]: channel for channel in channels}
    by_name = {n: c.channel for n, c in machine.components.items() if c.channel is not None}
    return {TIME: ("", TIME), **by_field, **by_name}


def parse_measure(name: str, table: object, channels: Mapping[str, Channel]) -> Measure:
    """A study's own measure.

    Parameters
    ----------
    name
        What the study calls it.
    table
        Its TOML table.
    channels
        Name in a formula → channel.

    Raises
    ------
    RigtwinError
        Naming the entry and what was expected.
    """
    where = f"measures.{name}"
    if not isinstance(table, Mapping):
        raise RigtwinError(f'{where}: expected a table with formula = "..."')
    known = ("formula", "of", "unit", "title", "more")
    for key in table:
        if key not in known:
            raise RigtwinError(f"{where}: unknown {key!r}; there are {', '.join(known)}")
    text, statistic, more = table.get("formula"), table.get("of", "rms"), table.get("more", False)
    words: dict[str, Any] = {"unit": table.get("unit", "1"), "title": table.get("title", name)}
    for key, value in (("formula", text), *words.items()):
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise RigtwinError(f"{where}.{key} = {value!r:.60}: expected text of one line")
    if len(words["title"]) > LONGEST or "$" in words["title"]:
        raise RigtwinError(
            f"{where}.title = {words['title']!r:.60}: expected at most {LONGEST} letters, none a $"
        )
    if not isinstance(statistic, str) or statistic not in STATISTICS:
        raise RigtwinError(f"{where}.of = {statistic!r:.40}: expected {', '.join(STATISTICS)}")
    if not isinstance(more, bool):
        raise RigtwinError(f"{where}.more = {more!r:.40}: expected true or false")
    try:
        inputs = formula(str(text), {}).inputs
    except ValueError as error:
        raise RigtwinError(f"{where}.formula: {error}") from None
    for each in inputs:
        if each not in channels:
            there = ", ".join(channels)
            raise RigtwinError(f"{where}.formula: unknown {each!r}; there are {there}")
    if not inputs:
        raise RigtwinError(f"{where}.formula = {text!r:.60}: expected a channel in it")
    figure = FormulaFigure(str(text), str(statistic), tuple(channels[each] for each in inputs))
    return Measure(name, words["title"], words["unit"], figure, more)
