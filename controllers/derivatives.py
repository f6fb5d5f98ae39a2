"""Derivatives and predictions from past samples, both exact for polynomials."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def derivative_weights(order: int, points: int, period: float) -> Array:
    """Return the weights of r[k], r[k−1], ... for a derivative at tick k, shape (points,).

    The derivative is exact for polynomials of a degree below `points`; period: s.
    """
    # Σ w_i (−i)^p must equal the derivative of τ^p at 0: a Vandermonde system.
    powers = np.vander(-np.arange(points, dtype=float), increasing=True).T
    right_side = np.zeros(points)
    right_side[order] = math.factorial(order) / period**order
    return np.asarray(np.linalg.solve(powers, right_side), dtype=np.float64)


def prediction_weights(ahead: float, points: int) -> Array:
    """Return the weights of r(t), r(t−h), ... that predict r(t + ahead·h), shape (points,).

    The prediction is exact for polynomials of a degree below `points`.
    """
    powers = np.vander(-np.arange(points, dtype=float), increasing=True).T
    return np.asarray(np.linalg.solve(powers, ahead ** np.arange(points)), dtype=np.float64)
