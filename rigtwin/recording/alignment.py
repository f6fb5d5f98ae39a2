"""Times of a recording's topics: their order, the ticks in common, gaps, and the period."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

if TYPE_CHECKING:
    pass

WRONG_PERIOD, DOUBTFUL_PERIOD = 0.02, 1e-3
"""Shares by which the spacing of time stamps may differ from the declared period: above the first a
recording is refused, above the second it has a note."""


def check_order(path: Path, topic: str, stamps: NDArray[np.int64], notes: list[str]) -> None:
    """Note messages that are out of order. Raise RigtwinError if most of them are."""
    falls = int(np.sum(np.diff(stamps) < 0))
    # A few messages out of order are normal for several writers; a reversed clock is not.
    if 2 * falls > len(stamps) - 1:
        raise RigtwinError(
            f"{path}: time on {topic} runs backwards, from {stamps[0] * 1e-9:.3f} s to "
            f"{stamps[-1] * 1e-9:.3f} s; expected rising times"
        )
    if falls:
        notes.append(f"{falls} messages on {topic} come after later ones; sorted by time")


def align(
    tables: Mapping[str, tuple[NDArray[np.int64], dict[str, Array]]], notes: list[str]
) -> tuple[Array, dict[str, dict[str, Array]]]:
    """Return the ticks that all topics have in common, in order."""
    first, *rest = (times for times, _ in tables.values())
    # Nearly always all topics have the same ascending times, and nothing needs to be sorted.
    if (np.diff(first) > 0).all() and all(np.array_equal(first, times) for times in rest):
        return first * 1e-9, {topic: dict(values) for topic, (_, values) in tables.items()}
    # np.unique also sorts, and drops repeated times, of which the first message counts.
    common = np.unique(first)
    for times in rest:
        common = np.intersect1d(common, times)
    columns: dict[str, dict[str, Array]] = {}
    for topic, (times, values) in tables.items():
        _, first = np.unique(times, return_index=True)
        # `first` are places of sorted unique times, so `keep` is in order of time, not of the
        # file.
        keep = first[np.isin(times[first], common)]
        if len(keep) < len(times):
            notes.append(
                f"{len(times) - len(keep)} messages on {topic} left out: repeated, "
                "or without their like on another topic"
            )
        columns[topic] = {name: column[keep] for name, column in values.items()}
    return common * 1e-9, columns


def check_times(path: Path, time: Array, period: float, notes: list[str]) -> None:
    """Note gaps in time. Raise RigtwinError if the period differs from the recorded one."""
    steps = np.diff(time)
    # Stamps may be rounded: their mean says more than any of them, gaps apart.
    typical = float(np.median(steps)) if len(steps) else period
    regular = steps[steps < 1.5 * max(typical, period)]
    spacing = float(np.mean(regular)) if len(regular) else typical
    off = abs(spacing - period) / period
    if off > WRONG_PERIOD:
        raise RigtwinError(
            f"{path}: its period is said to be {period:g} s, but messages come every "
            f"{spacing:.4g} s; expected time stamps within {100 * WRONG_PERIOD:g} % of the period"
        )
    if off > DOUBTFUL_PERIOD:
        notes.append(
            f"messages come every {spacing:.6g} s, {100.0 * off:.2g} % off the period of "
            f"{period:g} s, which is what ticks are taken for"
        )
    # Half a period separates jitter of the stamps from a tick that is missing.
    gaps = np.nonzero(np.abs(np.diff(time) - period) > 0.5 * period)[0]
    if len(gaps):
        notes.append(
            f"{len(gaps)} gaps in time, "
            f"the first of {np.diff(time)[gaps[0]]:.4g} s at {time[gaps[0]]:.3f} s"
        )
