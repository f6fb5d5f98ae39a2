"""A linear sampled law of the desired and the measured position.

Every delay compensator with constant coefficients takes this form:

    u[k]   = C x[k] + D (r[k], y[k])
    x[k+1] = A x[k] + B (r[k], y[k])

One function steps all of them, and their poles, noise and margins follow from four matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from controllers.compiled import compiled

Array = NDArray[np.float64]


class LinearLaw(NamedTuple):
    """Sampled law from desired and measured position to the command.

    Attributes
    ----------
    a : ndarray
        Transition matrix, shape (n, n).
    b : ndarray
        Input matrix, shape (n, 2); the columns are desired and measured.
    c, d : ndarray
        Output vector, shape (n,), and feedthrough, shape (2,).
    """

    a: Array
    b: Array
    c: Array
    d: Array


def pass_through() -> LinearLaw:
    """Return the law without compensation: the command is the desired position."""
    return LinearLaw(np.zeros((1, 1)), np.zeros((1, 2)), np.zeros(1), np.array([1.0, 0.0]))


def filtered(weights: Array) -> LinearLaw:
    """Return the law u[k] = Σ weights[i] r[k−i]; weights: shape (n,)."""
    size = max(len(weights) - 1, 1)
    entry = np.zeros((size, 2))
    entry[0, 0] = 1.0
    # The states are the last desired positions, a shift register.
    delayed_weights = np.zeros(size)
    delayed_weights[: len(weights) - 1] = weights[1:]
    return LinearLaw(np.eye(size, k=-1), entry, delayed_weights, np.array([weights[0], 0.0]))


def add_feedback(law: LinearLaw, proportional: float, integral: float, period: float) -> LinearLaw:
    """Return a law with a PI feedback of desired minus measured position added to its command.

    proportional: 1; integral: 1/s, summed after the tick (forward Euler); period: s.
    """
    a = np.asarray(block_diag(law.a, np.eye(1)))
    b = np.vstack([law.b, [[period, -period]]])
    d = law.d + proportional * np.array([1.0, -1.0])
    return LinearLaw(a, b, np.append(law.c, integral), d)


@compiled
def step_linear(law: LinearLaw, state: Array, desired: float, measured: float) -> float:
    """Return the command of one tick; state: shape (n,), advanced in place."""
    size = len(state)
    command = law.d[0] * desired + law.d[1] * measured
    next_state = np.empty(size)
    for row in range(size):
        command += law.c[row] * state[row]
        total = law.b[row, 0] * desired + law.b[row, 1] * measured
        for column in range(size):
            total += law.a[row, column] * state[column]
        next_state[row] = total
    state[:] = next_state
    return command
