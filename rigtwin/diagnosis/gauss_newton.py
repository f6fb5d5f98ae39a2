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
ITERATIONS = 16
"""Times that derivatives are taken at most."""
GAINED = 0.2
"""χ² that a step must gain to be followed by another."""
DAMPING = 1e-6
"""Share of the normal matrix' diagonal that is added to it."""


SHARE = 1e-3
"""Share of the misfit beyond noise that a step must gain as well: beside what a model always
leaves, smaller gains say nothing."""
WIDEST, WIDENED = 5.0, 1.1
"""Factor by which the steps of the derivatives are widened once where nothing is gained, if the
misfit is that many times what noise leaves. Stick-slip makes the misfit discontinuous, and wide
steps see over its small jumps."""


OVERESTIMATED = 0.8
"""Share of the expected misfit below which the noise was estimated too large."""
RESPONSE, SHORTEST = 0.05, 1e-3
"""Share of the misfit that a derivative's step should change, and share of the given step that it
has at least."""


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
    expected: float,
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
    expected
        Misfit of noise alone.

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
    wide, scale = 1.0, np.ones(len(here))
    for _ in range(ITERATIONS):
        taken = wide * scale
        jacobian = take_derivatives(residual, here, left, taken * steps, high) / taken
        scale = shorten(jacobian, misfit)
        normal, gradient = space.normal_equations(jacobian, left)
        damped = normal + np.diag(DAMPING * np.diag(normal) + 1e-12)
        move = -np.linalg.solve(damped, gradient)
        enough, gained = max(GAINED, SHARE * (misfit - expected)), 0.0
        if -float(gradient @ move) >= enough:
            for part in PARTS:
                there = np.clip(here + part * move * steps, low, high)
                tried = residual(there)
                if (value := space.misfit(tried)) < misfit:
                    gained = misfit - value
                    here, left, misfit = there, tried, value
                    break
        if gained < enough:
            if wide == WIDEST or is_sufficient(misfit, expected):
                break
            wide = WIDEST
    widths = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0.0)) * steps
    return Minimum(here, misfit, widths)


def is_sufficient(misfit: float, expected: float, enough: float = WIDENED) -> bool:
    """Whether a fit leaves about what noise does, so that no closer one need be looked for.

    One that leaves much less shows that the expected noise was too large; closer ones still matter.
    """
    return OVERESTIMATED * expected < misfit < enough * expected


def shorten(jacobian: Array, misfit: float) -> Array:
    """Shorten the steps of derivatives that change more than is left of the residual.

    A response to such a step is a secant far from the tangent.

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
    least = RESPONSE * misfit + SHORTEST**2 * power
    return np.asarray(np.sqrt(least / np.maximum(power, least)))


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
