"""The type of every numerical array, and a bound on what a model may predict."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
"""Real numbers, in practice float64; shape and unit are said where one is used."""
RUNAWAY = 1e6
"""In any unit of a machine's signals: none goes there."""


def contain(signals: Array) -> Array:
    """Signals within what is possible: a plant that is not stable runs away; it must be a bad
    explanation, not an impossible number."""
    if float(np.abs(signals).max()) <= RUNAWAY:
        return signals
    return np.clip(np.nan_to_num(signals, nan=RUNAWAY), -RUNAWAY, RUNAWAY)


def runs_away(motion: Array) -> bool:
    """Whether positions and velocities, the first two rows, go where nothing can."""
    return not np.isfinite(motion).all() or float(np.max(np.abs(motion[:2]))) >= RUNAWAY


def interpolate(time: Array, values: Array, at: Array) -> Array:
    """A signal between its samples, by a cubic spline; time: shape (ticks,), increasing."""
    from scipy.interpolate import CubicSpline  # Late: it takes a quarter of a second.

    return CubicSpline(time, values)(at)
