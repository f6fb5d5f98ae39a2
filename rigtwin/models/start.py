"""Reading and fitting the initial state of a recording: positions and velocities of joints."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigtwin.numerics.arrays import Array

STEPS, LIKELY = 4, 10.0
"""Largest number of Gauss-Newton steps. Width of the prior of the initial state, in standard errors
of the state as read."""
SHARES, ENOUGH = (1.0, 0.25), 1e-5
"""Shares of a Gauss-Newton step that are tried in turn. Relative decrease of the cost below which
the fit ends."""
BEGINNING = 0.03
"""Time from which the initial state is read, s."""
FEWEST = 8
"""Smallest number of samples from which it is read."""
ORDERS, CLOSE = (2, 3, 4), 1.5
"""Orders of the polynomial, and the largest residual, in noise standard deviations, at which no
higher order is tried."""
NOTHING = np.empty(0)
"""No samples."""
# A parabola fitted to n samples of noise σ has, at its end, a standard deviation of 3σ/√n in value
# and of 8√3·σ/(n·√n·period) = 13.9 σ/(n·√n·period) in slope, for large n. For the value, 3σ without
# the division is on the safe side.
ERRORS, OF_END = 3.0, 14.0
"""Error of the parabola's end, in noise standard deviations, and of its slope there, in
σ / (√n · n · period)."""
Start = tuple[float, float]
"""Initial position and velocity of a joint, m and m/s."""


def read_start(
    measured: Array, period: float, noise: float = math.inf, earlier: Array = NOTHING
) -> Start:
    """Read value and slope at the start by a polynomial through the samples around it.

    Parameters
    ----------
    measured
        Measured position from the start on, m, shape (ticks,).
    period
        Time from tick to tick, s.
    noise
        Standard deviation of a sample, m. A parabola that leaves more is too stiff for the motion.
    earlier
        Measured position before the start, m, shape (earlier ticks,).

    Returns
    -------
    tuple
        Position and velocity, m and m/s.
    """
    ticks = _ticks(period, len(measured))
    samples = np.concatenate([earlier[-ticks:], measured[:ticks]])
    times = (np.arange(len(samples)) - len(earlier[-ticks:])) * period
    curve = np.polynomial.Polynomial.fit(times, samples, ORDERS[0])
    for order in ORDERS[1:]:
        free = len(samples) - curve.degree() - 1
        rest = samples - curve(times)
        # Without samples to spare, a polynomial of higher order follows the noise.
        if free < order or rest @ rest <= (CLOSE * noise) ** 2 * free:
            break
        curve = np.polynomial.Polynomial.fit(times, samples, order)
    return float(curve(0.0)), float(curve.deriv()(0.0))


def start_error(noise: float, period: float, count: int) -> Start:
    """Return the largest plausible errors of `read_start`.

    Parameters
    ----------
    noise
        Standard deviation of a sample, m.
    period
        Time from tick to tick, s.
    count
        Number of samples in the recording.

    Returns
    -------
    tuple
        Errors of position and velocity, m and m/s.
    """
    ticks = _ticks(period, count)
    return ERRORS * noise, OF_END * noise / (np.sqrt(ticks) * ticks * period)


def _ticks(period: float, count: int) -> int:
    return min(max(FEWEST, round(BEGINNING / period)), count)


def find_slopes(
    predict: Callable[[Array], Array], first: Array, error: Array, predicted: Array
) -> Array:
    """Return the change of a prediction by one standard error of each unknown.

    Parameters
    ----------
    predict
        Prediction of the measured signals, shape (n,), from an initial state.
    first
        Initial state as read, shape (unknowns,).
    error
        Its standard errors, shape (unknowns,).
    predicted
        Prediction from `first`, shape (n,).

    Returns
    -------
    array
        Differences, shape (n, unknowns).
    """
    # Differences over a whole standard error average over the kinks that dry friction makes.
    return np.stack([predict(first + step) - predicted for step in np.diag(error)], axis=1)


def fit_start(
    predict: Callable[[Array], Array],
    measured: Array,
    first: Array,
    error: Array,
    tolerance: float | Array,
    slopes: Array,
    predicted_begun: Array,
    begun: Array | None = None,
) -> tuple[Array, Array]:
    """Fit the initial state to the measured signals by damped Gauss-Newton steps.

    With θ the state's change in standard errors, it minimises

        |(measured − predict(first + error·θ)) / tolerance|² + |θ|² / LIKELY²

    Parameters
    ----------
    predict
        Prediction of the measured signals, shape (n,), from an initial state.
    measured
        Measured signals, shape (n,).
    first
        Initial state as read: positions, then velocities, shape (unknowns,).
    error
        Its standard errors, shape (unknowns,).
    tolerance
        Standard deviation to which the signals can be predicted at best; a number, or shape (n,).
    slopes
        Derivatives by `find_slopes`, shape (n, unknowns).
    predicted_begun
        Prediction from `begun`, shape (n,).
    begun
        State from which the fit begins, shape (unknowns,). Default: `first`.

    Returns
    -------
    tuple of arrays
        Positions and velocities, shape (unknowns,), and the prediction from them, shape (n,).
    """
    columns, prior = (slopes.T / tolerance).T, np.eye(len(first)) / LIKELY**2
    moved = np.zeros(len(first)) if begun is None else (begun - first) / error
    predicted = predicted_begun
    residual, cost = _weigh(measured, predicted, tolerance, moved)
    for _ in range(STEPS):
        pull = columns.T @ residual - moved / LIKELY**2
        step = np.linalg.solve(columns.T @ columns + prior, pull)
        # The linear model's decrease of the cost tells without a prediction that the fit ends.
        if float(pull @ step) <= ENOUGH * cost:
            break
        before = cost
        for share in SHARES:
            # Where a joint sticks or swings over, the derivatives may mislead: accept a step only
            # if it lowers the cost.
            tried = moved + share * step
            tried_predicted = predict(first + error * tried)
            tried_residual, tried_cost = _weigh(measured, tried_predicted, tolerance, tried)
            columns = _correct(columns, tried - moved, residual - tried_residual)
            if tried_cost < cost:
                moved, predicted = tried, tried_predicted
                residual, cost = tried_residual, tried_cost
                break
        if before - cost <= ENOUGH * before:
            break
    return first + error * moved, predicted


def _weigh(
    measured: Array, predicted: Array, tolerance: float | Array, moved: Array
) -> tuple[Array, float]:
    """Return weighted residual and cost of a prediction, `moved` standard errors from the first."""
    residual = (measured - predicted) / tolerance
    return residual, float(residual @ residual + moved @ moved / LIKELY**2)


def _correct(columns: Array, step: Array, change: Array) -> Array:
    """Return derivatives that agree with the change of a step, otherwise as they were.

    This is Broyden's first update [Mathematics of Computation 19 (1965) 577]: without a further
    prediction, it replaces derivatives that were taken at another state or for another machine.
    """
    return columns + np.outer(change - columns @ step, step / float(step @ step))
