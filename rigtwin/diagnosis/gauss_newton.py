"""The values of a few parameters that leave least of a residual, by Gauss-Newton with shortened
steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

PARTS = (1.0, 0.5, 0.2, 0.05)
"""Of a step that are tried in turn."""
ITERATIONS = 8
"""Times that derivatives are taken at most."""
GAINED = 0.2
"""χ² that a step must gain to be followed by another."""
DAMPING = 1e-6
"""Share of the normal matrix' diagonal that is added to it."""


@dataclass(frozen=True)
class Descent:
    """How a minimum is gone down to. share: of the misfit that a step must gain besides `GAINED`;
    widest: times the steps of the derivatives to which they are widened where nothing is
    gained."""

    share: float
    widest: float


CLOSELY = Descent(share=0.0, widest=1.0)
"""Of a model that leaves nothing but noise."""
ROUGHLY = Descent(share=1e-3, widest=5.0)
"""Of one that always leaves something, beside which small gains say nothing, and whose misfit has
small steps where something sticks: wide ones see over them."""


@dataclass(frozen=True)
class Minimum:
    """values: of the parameters, shape (parameters,); misfit: there; widths: their standard
    deviations."""

    values: Array
    misfit: float
    widths: Array


def minimise(
    residual: Callable[[Array], Array],
    space: Space,
    start: Array,
    steps: Array,
    bounds: tuple[Array, Array],
    descent: Descent,
) -> Minimum:
    """Goes down from a start.

    Parameters
    ----------
    residual
        Of values, shape (parameters,), whitened.
    space
        The tolerances that are free beside them.
    start, steps
        Values, and steps of their derivatives, shape (parameters,).
    bounds
        Lowest and highest values.
    descent
        How.

    Returns
    -------
    Minimum
        Where no step gains any more.
    """
    low, high = bounds
    here = np.clip(start, low, high)
    left = residual(here)
    misfit = space.misfit(left)
    normal = np.eye(len(here))
    wide = 1.0
    for _ in range(ITERATIONS):
        jacobian = take_derivatives(residual, here, left, wide * steps, high) / wide
        normal, gradient = space.normal_equations(jacobian, left)
        damped = normal + np.diag(DAMPING * np.diag(normal) + 1e-12)
        move = -np.linalg.solve(damped, gradient)
        enough, gained = max(GAINED, descent.share * misfit), 0.0
        if descent.share == 0.0 or -float(gradient @ move) >= enough:
            for part in PARTS:
                there = np.clip(here + part * move * steps, low, high)
                tried = residual(there)
                if (value := space.misfit(tried)) < misfit:
                    gained = misfit - value
                    here, left, misfit = there, tried, value
                    break
        if gained < enough:
            if wide >= descent.widest:
                break
            wide = descent.widest
    widths = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0.0)) * steps
    return Minimum(here, misfit, widths)


def take_derivatives(
    residual: Callable[[Array], Array], here: Array, left: Array, steps: Array, high: Array
) -> Array:
    """What a step of each parameter changes.

    Parameters
    ----------
    residual
        Of values, shape (parameters,).
    here, left
        Values, and what they leave.
    steps, high
        How far each is moved, upwards where that is not beyond its highest value.

    Returns
    -------
    array
        Shape (size, parameters).
    """
    columns = []
    for number, step in enumerate(steps):
        sign = 1.0 if here[number] + step <= high[number] else -1.0
        beside = here.copy()
        beside[number] += sign * step
        columns.append(sign * (residual(beside) - left))
    return np.stack(columns, axis=1)
