"""Sampled filter (ω/(s + ω))^n whose states are the filtered signal and its derivatives."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from controllers.compiled import compilable

Array = NDArray[np.float64]


class StateFilter(NamedTuple):
    """Sampled filter; its states are the derivatives 0 to n − 1, divided by corner^order.

    Attributes
    ----------
    a, b : ndarray
        Transition matrix, shape (n, n), and input vector, shape (n,).
    corner : float
        Corner frequency, rad/s.
    """

    a: Array
    b: Array
    corner: float


def state_filter(order: int, corner: float, period: float) -> StateFilter:
    """Return a filter with n = order states; corner: Hz, period: s."""
    # (1 + s/ω)^n y = u in controllable form; the binomials are its coefficients.
    omega = 2.0 * math.pi * corner
    augmented = np.zeros((order + 1,) * 2)
    augmented[: order - 1, 1:order] = np.eye(order - 1)
    augmented[order - 1, :order] = [-float(math.comb(order, power)) for power in range(order)]
    augmented[order - 1, order] = 1.0
    augmented = np.asarray(expm(augmented * omega * period), dtype=np.float64)
    return StateFilter(
        np.ascontiguousarray(augmented[:order, :order]),
        np.ascontiguousarray(augmented[:order, order]),
        omega,
    )


@compilable
def step_filter(motion_filter: StateFilter, state: Array, held: float) -> None:
    """Advance a state, shape (n,), in place by one period of a held input."""
    size = len(state)
    next_state = np.empty(size)
    for row in range(size):
        total = motion_filter.b[row] * held
        for column in range(size):
            total += motion_filter.a[row, column] * state[column]
        next_state[row] = total
    state[:] = next_state
