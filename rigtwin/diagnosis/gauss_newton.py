"""Gauss-Newton minimisation of a misfit in a few bounded parameters.

With the residual r, its jacobian J in units of the parameters' steps, and the tolerances eliminated
from the normal equations (`Space.normal_equations`), an iteration solves

    (N + D) m = -g,        D = DAMPING diag(N),

and tries the shares 1, 0.5, 0.2 and 0.05 of the move m until the misfit falls
[Nocedal, Wright, Numerical Optimization, 2006, chapter 10].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

MOVE_SHARES = (1.0, 0.5, 0.2, 0.05)
"""Shares of a move that are tried in turn."""
ITERATIONS = 16
"""Largest number of iterations."""
LEAST_GAIN = 0.2
"""Chi-square that a move must gain for the minimisation to continue."""
DAMPING = 1e-6
"""Share of the normal matrix' diagonal that is added to it."""
LEAST_GAIN_SHARE = 1e-3
"""Share of the misfit beyond noise that a move must gain as well. Where the model's own error
dominates the misfit, smaller gains are not significant."""
WIDENING = 5.0
"""Factor by which the steps of the derivatives are widened once, where no move gains anything.
Stick-slip makes the misfit discontinuous, and a wide step averages over its small jumps."""
SUFFICIENT_MISFIT = 1.1
"""Ratio of the misfit to that of noise below which a fit is close enough."""
OVERESTIMATED = 0.8
"""Ratio of the misfit to that of noise below which the noise was overestimated."""
LARGEST_RESPONSE = 0.05
"""Largest share of the misfit that the step of a derivative should change."""
SHORTEST_STEP = 1e-3
"""Shortest step of a derivative, as a share of the given step."""


@dataclass(frozen=True)
class Minimum:
    """Result of a minimisation.

    Attributes
    ----------
    values
        Values of the parameters, shape (parameters,).
    misfit
        Chi-square at these values.
    widths
        Standard deviation of each value, shape (parameters,).
    """

    values: Array
    misfit: float
    widths: Array


def minimise(
    residual: Callable[[Array], Array],
    space: Space,
    start: Array,
    steps: Array,
    bounds: tuple[Array, Array],
    expected: float,
) -> Minimum:
    """Minimise a misfit from one start.

    Parameters
    ----------
    residual
        Function of the values, shape (parameters,), that returns the whitened residual.
    space
        Tolerances that are free beside the parameters.
    start, steps
        Starting values, and steps of their derivatives, shape (parameters,).
    bounds
        Lowest and highest values, shape (parameters,) each.
    expected
        Misfit of noise alone.

    Returns
    -------
    Minimum
        Values from which no move gains enough to continue.
    """
    values = np.clip(start, *bounds)
    current = residual(values)
    misfit = space.misfit(current)
    normal = np.eye(len(values))
    widening, shortening = 1.0, np.ones(len(values))
    for _ in range(ITERATIONS):
        factors = widening * shortening
        # Divided by the factors, the columns stay in units of the original steps, and so does the
        # move.
        jacobian = take_derivatives(residual, values, current, factors * steps, bounds[1]) / factors
        # The responses just taken shorten the steps of the next iteration.
        shortening = shorten(jacobian, misfit)
        normal, gradient = space.normal_equations(jacobian, current)
        # The constant keeps the matrix regular where a parameter has no effect.
        damped = normal + np.diag(DAMPING * np.diag(normal) + 1e-12)
        move = -np.linalg.solve(damped, gradient)
        enough, gained = max(LEAST_GAIN, LEAST_GAIN_SHARE * (misfit - expected)), 0.0
        # A quadratic misfit would fall by -g'm; a smaller promise is not worth a prediction.
        if -float(gradient @ move) >= enough:
            improved = _try_move(residual, space, values, move, steps, bounds, misfit)
            if improved is not None:
                gained = misfit - improved[2]
                values, current, misfit = improved
        if gained < enough:
            if widening == WIDENING or is_sufficient(misfit, expected):
                break
            widening = WIDENING
    # The covariance of least squares with unit variance is the inverse of the normal matrix.
    widths = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0.0)) * steps
    return Minimum(values, misfit, widths)


def _try_move(
    residual: Callable[[Array], Array],
    space: Space,
    values: Array,
    move: Array,
    steps: Array,
    bounds: tuple[Array, Array],
    misfit: float,
) -> tuple[Array, Array, float] | None:
    """Return values, residual and misfit after a share of a move; None if none lowers the misfit.

    `move` is in units of `steps`.
    The first share that lowers the misfit is taken. An exact line search would cost more
    predictions than the next iteration.
    """
    for share in MOVE_SHARES:
        moved = np.clip(values + share * move * steps, *bounds)
        tried = residual(moved)
        if (value := space.misfit(tried)) < misfit:
            return moved, tried, value
    return None


def is_sufficient(misfit: float, expected: float, ratio: float = SUFFICIENT_MISFIT) -> bool:
    """Return whether a misfit is about that of noise, so that no closer fit is needed.

    A much smaller misfit shows that the noise was overestimated. Closer fits then still matter.

    Parameters
    ----------
    misfit, expected
        Chi-square of the fit and of noise alone.
    ratio
        Ratio of both below which the fit is close enough.

    Returns
    -------
    bool
        True if the misfit is below `ratio` and the noise not overestimated.
    """
    return OVERESTIMATED * expected < misfit < ratio * expected


def shorten(jacobian: Array, misfit: float) -> Array:
    """Return by how much the steps of derivatives should be shortened.

    A step that changes more than the residual itself gives a secant far from the tangent.

    Parameters
    ----------
    jacobian
        Response to each step, shape (size, parameters).
    misfit
        Chi-square of the residual.

    Returns
    -------
    array
        Share of each step that should be taken, at most 1, shape (parameters,).
    """
    power = np.sum(jacobian**2, axis=0)
    least = LARGEST_RESPONSE * misfit + SHORTEST_STEP**2 * power
    # The power of a response is quadratic in its step.
    return np.asarray(np.sqrt(least / np.maximum(power, least)))


def take_derivatives(
    residual: Callable[[Array], Array], values: Array, current: Array, steps: Array, high: Array
) -> Array:
    """Return the change of a residual for a step of each parameter, by one-sided differences.

    Parameters
    ----------
    residual
        Function of the values, shape (parameters,).
    values, current
        Values, and the residual at them.
    steps
        Step of each parameter, shape (parameters,).
    high
        Highest values. A step that would exceed its highest value is taken downwards.

    Returns
    -------
    array
        Change per step, shape (size, parameters).
    """
    columns = []
    for number, step in enumerate(steps):
        # One-sided differences cost one prediction per parameter and central ones two. Their error
        # slows the iteration; the misfit is exact in any case.
        sign = 1.0 if values[number] + step <= high[number] else -1.0
        shifted = values.copy()
        shifted[number] += sign * step
        columns.append(sign * (residual(shifted) - current))
    return np.stack(columns, axis=1)
