"""Derivatives from samples up to now, and values ahead of now: both exact for polynomials."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def derivative_weights(order: int, points: int, period: float) -> Array:
    """Weights of r[k], r[k−1], ... that give the derivative of that order at tick k, exactly for
    polynomials of a degree below `points`; shape (points,), period s."""
    powers = np.vander(-np.arange(points, dtype=float), increasing=True).T
    wanted = np.zeros(points)
    wanted[order] = math.factorial(order) / period**order
    return np.asarray(np.linalg.solve(powers, wanted), dtype=np.float64)


def prediction_weights(ahead: float, points: int) -> Array:
    """Weights of r(t), r(t−h), ... that give r(t + ahead·h), exactly for polynomials of a degree
    below `points`; shape (points,)."""
    powers = np.vander(-np.arange(points, dtype=float), increasing=True).T
    return np.asarray(np.linalg.solve(powers, ahead ** np.arange(points)), dtype=np.float64)
