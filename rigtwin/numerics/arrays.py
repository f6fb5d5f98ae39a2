"""Type of all numerical arrays, and a bound on predicted signals."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, get_type_hints

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


def to_records(kind: type[Any], rows: Sequence[Any]) -> np.ndarray:
    """Return named tuples of numbers as an array of records, shape (rows,).

    Compiled code reads a record's field from memory. A named tuple would be copied as a whole, many
    times in every step, wherever its index is known at run time only.

    Parameters
    ----------
    kind
        Named tuple whose fields are all `float` or `bool`.
    rows
        Instances of it.
    """
    return np.array([tuple(row) for row in rows], _record_type(kind))


@cache
def _record_type(kind: type[Any]) -> np.dtype[Any]:
    hints = get_type_hints(kind)
    return np.dtype([(name, hints[name]) for name in hints], align=True)
