"""A filter whose states are a signal and its derivatives: (ω/(s + ω))^n of the signal, sampled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from controllers.compiled import compilable

Array = NDArray[np.float64]


class StateFilter(NamedTuple):
    """a: (n, n), b: (n,), sampled; the states are the derivatives of order 0 to n−1, each divided
    by corner^order. corner: rad/s."""

    a: Array
    b: Array
    corner: float


def state_filter(order: int, corner: float, period: float) -> StateFilter:
    """Of n = order states; corner: Hz, period: s."""
    omega = 2.0 * math.pi * corner
    both = np.zeros((order + 1,) * 2)
    both[: order - 1, 1:order] = np.eye(order - 1)
    both[order - 1, :order] = [-float(math.comb(order, power)) for power in range(order)]
    both[order - 1, order] = 1.0
    both = np.asarray(expm(both * omega * period), dtype=np.float64)
    return StateFilter(
        np.ascontiguousarray(both[:order, :order]),
        np.ascontiguousarray(both[:order, order]),
        omega,
    )


@compilable
def step_filter(one: StateFilter, state: Array, held: float) -> None:
    """Advances a state (n,) in place by one period of a held input."""
    size = len(state)
    after = np.empty(size)
    for row in range(size):
        total = one.b[row] * held
        for column in range(size):
            total += one.a[row, column] * state[column]
        after[row] = total
    state[:] = after
