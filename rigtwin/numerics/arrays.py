"""Type of all numerical arrays, and a bound on predicted signals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
"""Array of real numbers, in practice float64. Shape and unit are documented where it is used."""
RUNAWAY = 1e6
"""Bound of every signal, in its unit. No machine's signal comes near it."""


def clip_diverged(signals: Array) -> Array:
    """Return signals clipped to the bound.

    An unstable plant diverges. Its misfit must be large but finite, so that a search can go on.
    """
    if float(np.abs(signals).max()) <= RUNAWAY:
        return signals
    return np.clip(np.nan_to_num(signals, nan=RUNAWAY), -RUNAWAY, RUNAWAY)


def has_diverged(motion: Array) -> bool:
    """Return whether positions or velocities, the first two rows, exceed the bound."""
    return not np.isfinite(motion).all() or float(np.max(np.abs(motion[:2]))) >= RUNAWAY


def interpolate(time: Array, values: Array, at: Array) -> Array:
    """Interpolate a signal by a cubic spline; the times, shape (ticks,), ascend."""
    # scipy.interpolate is imported here because it takes a quarter of a second to load.
    from scipy.interpolate import CubicSpline

    return CubicSpline(time, values)(at)
