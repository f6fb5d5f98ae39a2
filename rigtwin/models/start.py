"""Where a joint is and how fast it goes when a recording starts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigtwin.numerics.arrays import Array

STEPS, LIKELY = 4, 10.0
"""Gauss-Newton steps, and errors of the first samples within which a start lies."""
SHARES, ENOUGH = (1.0, 0.25), 1e-5
"""Of a step that are tried, and of the cost that a further step must save."""
BEGINNING = 0.03
"""s, from which a start is read."""
FEWEST = 8
"""Samples that it is read from at least."""
ERRORS, OF_END = 3.0, 14.0
"""Of a parabola through n samples of noise σ: its end is off by up to 3 σ, its slope there by up to
14 σ / (√n · n · period)."""
Start = tuple[float, float]
"""Position m and velocity m/s."""


def read_start(measured: Array, period: float) -> Start:
    """The start by a parabola through the first samples.

    Parameters
    ----------
    measured
        Position, shape (ticks,).
    period
        s, of a tick.

    Returns
    -------
    tuple
        Position and velocity.
    """
    ticks = _ticks(period, len(measured))
    curve = np.polynomial.Polynomial.fit(np.arange(ticks) * period, measured[:ticks], 2)
    return float(curve(0.0)), float(curve.deriv()(0.0))


def start_error(noise: float, period: float, count: int) -> Start:
    """How far `read_start` may be off.

    Parameters
    ----------
    noise
        Standard deviation of a sample.
    period
        s, of a tick.
    count
        Samples there are.

    Returns
    -------
    tuple
        Of position and velocity.
    """
    ticks = _ticks(period, count)
    return ERRORS * noise, OF_END * noise / (np.sqrt(ticks) * ticks * period)


def _ticks(period: float, count: int) -> int:
    return min(max(FEWEST, round(BEGINNING / period)), count)


def find_slopes(
    predict: Callable[[Array], Array], first: Array, error: Array, here: Array
) -> Array:
    """How a prediction changes with each unknown of a start by its error.

    Parameters
    ----------
    predict
        What is measured, shape (n,), from a start.
    first, error
        The start as it was read, and its error, shape (unknowns,).
    here
        What is predicted of it, shape (n,).

    Returns
    -------
    array
        Shape (n, unknowns).
    """
    return np.stack([predict(first + step) - here for step in np.diag(error)], axis=1)


def fit_start(
    predict: Callable[[Array], Array],
    measured: Array,
    first: Array,
    error: Array,
    held: float | Array,
    slopes: Array,
    here: Array,
) -> Array:
    """The start with which a machine goes as measured.

    Parameters
    ----------
    predict
        What is measured, shape (n,), from a start.
    measured
        The same as it was, shape (n,).
    first
        The start as it was read: positions, then velocities, shape (unknowns,).
    error
        Of that, shape (unknowns,).
    held
        To what it is predicted at best; a number, or shape (n,).
    slopes
        As `find_slopes` has them.
    here
        What is predicted of `first`, shape (n,).

    Returns
    -------
    array
        Positions and velocities, shape (unknowns,).
    """
    columns = (slopes.T / held).T
    # A start is known well enough to begin with that the derivatives there do for all steps.
    normal = columns.T @ columns + np.eye(len(first)) / LIKELY**2

    def weigh(predicted: Array, moved: Array) -> tuple[Array, float]:
        """What is left of a prediction, and its cost, from so many errors beside `first`."""
        left = (measured - predicted) / held
        return left, float(left @ left + moved @ moved / LIKELY**2)

    moved = np.zeros(len(first))
    left, cost = weigh(here, moved)
    for _ in range(STEPS):
        step, before = np.linalg.solve(normal, columns.T @ left - moved / LIKELY**2), cost
        for share in SHARES:
            # Of what swings over or sticks the derivatives may say nothing.
            tried = moved + share * step
            there, other = weigh(predict(first + error * tried), tried)
            if other < cost:
                moved, left, cost = tried, there, other
                break
        if before - cost <= ENOUGH * before:
            break
    return first + error * moved
