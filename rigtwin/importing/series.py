"""Series: a signal with times of its own, and series joined on the times of one of them."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rigtwin.numerics.arrays import Array


class Join(Enum):
    """How a series is taken to the times of another one."""

    INTERPOLATE = "interpolated"
    """A measurement, straight between its samples, and nowhere else."""
    HOLD = "held"
    """A command, which holds until the next one comes."""
    PLAN = "interpolated, then held"
    """A planned motion: straight between its points; its last point holds."""


@dataclass
class Series:
    """Samples of one signal.

    Parameters
    ----------
    times
        ns, one a sample.
    numbers
        Values, one a sample.
    join
        Method by which the signal is evaluated at other times.
    """

    times: array[int] = field(default_factory=lambda: array("q"))
    numbers: array[float] = field(default_factory=lambda: array("d"))
    join: Join = Join.HOLD

    def add(self, time: int, number: float) -> None:
        """Add a sample at a time in ns."""
        self.times.append(time)
        self.numbers.append(number)

    def cut(self, time: int) -> None:
        """Drop the samples at this time, in ns, and after it, which a new plan replaces."""
        while self.times and self.times[-1] >= time:
            self.times.pop()
            self.numbers.pop()

    def sorted(self) -> tuple[NDArray[np.int64], Array]:
        """Return times in ns, rising, and the values, both of shape (samples,)."""
        times = np.array(self.times, np.int64)
        # Stable: of samples with one time the last received one stays last.
        order = np.argsort(times, kind="stable")
        return times[order], np.array(self.numbers, float)[order]


def join_series(series: Series, base: NDArray[np.int64], shift: int = 0) -> Array:
    """Take a series to other times.

    Parameters
    ----------
    series
        Samples of the signal.
    base
        Times, ns, rising, shape (rows,).
    shift
        Time to add to those of the series, ns.

    Returns
    -------
    array
        Shape (rows,); not a number before the first sample, and after the last one of a
        measurement.
    """
    times, values = series.sorted()
    if not len(times):
        return np.full(len(base), np.nan)
    times = times + shift
    # Signals of one message share its times, and need no interpolation.
    if np.array_equal(times, base):
        return values
    # Times since the first row, so that floats resolve them.
    start, since = base[0], (times - base[0]) * 1e-9
    rows = (base - start) * 1e-9
    if series.join is Join.HOLD:
        last = np.searchsorted(times, base, side="right") - 1
        return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)
    # np.interp holds the end values outside, which are then removed where they are not known.
    joined = np.interp(rows, since, values)
    joined[base < times[0]] = np.nan
    if series.join is Join.INTERPOLATE:
        joined[base > times[-1]] = np.nan
    return joined
