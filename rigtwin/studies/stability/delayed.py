"""The rightmost root of a loop with pure delays, whose characteristic function has infinitely
many."""

from __future__ import annotations

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.loop import Loop, Roots, bound, delay_function, instant, order
from rigtwin.studies.stability.vehicle import checked_time

FEWEST, MOST = 20, 160
"""Chebyshev nodes over the longest delay, less one: some for accuracy beside those that an
oscillation over it needs."""
CANDIDATES = 24
NEWTON_STEPS = 50


def rightmost_delay_root(loop: Loop, delay: float) -> complex:
    """The rightmost root with z = exp(−delay s), delay in s: of a pair the one with positive
    frequency, 1/s.

    The delay differential equation's infinitesimal generator is discretised at Chebyshev nodes
    (Breda, Maset and Vermiglio 2005); its rightmost eigenvalues are then refined by Newton's method
    on the characteristic function itself.
    """
    checked_time("delay", delay)
    span = delay * order(loop)
    nodes = int(min(FEWEST + 0.5 * bound(loop) * span, MOST))
    eigenvalues = _generator_eigenvalues(loop, delay, nodes)
    rightmost = eigenvalues[np.argsort(-eigenvalues.real)][:CANDIDATES]
    refined = (_refine(loop, delay, start) for start in rightmost)
    found = [root for root in refined if root is not None]
    if not found:
        raise RigtwinError(
            f"no root found with a delay of {delay:g} s: expected a loop of bounded frequencies",
        )
    best = max(found, key=lambda root: root.real)
    return complex(best.real, abs(best.imag))


def _generator_eigenvalues(loop: Loop, delay: float, nodes: int) -> Roots:
    # In units of the loop's own frequency, so that no derivative outweighs the others.
    scale = float(np.exp(np.mean(np.log(np.abs(instant(loop).roots())))))
    degree = loop[0].degree()
    powers = scale ** np.arange(degree + 1)
    leading = loop[0].coef[-1] * powers[-1]
    longest = scale * delay * order(loop)
    angles = np.pi * np.arange(nodes + 1) / nodes
    points = np.cos(angles)
    weights = (-1.0) ** np.arange(nodes + 1) * np.where(
        (angles == 0.0) | (np.arange(nodes + 1) == nodes),
        0.5,
        1.0,
    )
    generator = np.kron(_derivative(points, weights) * (2.0 / longest), np.eye(degree))
    generator[:degree] = 0.0
    generator[: degree - 1, 1:degree] = np.eye(degree - 1)
    for power, polynomial in loop.items():
        coefficients = np.zeros(degree + 1)
        coefficients[: len(polynomial.coef)] = polynomial.coef
        at = _interpolation(points, weights, 1.0 - 2.0 * power / order(loop))
        generator[degree - 1] -= np.kron(at, (coefficients * powers / leading)[:degree])
    return scale * np.linalg.eigvals(generator)


def _derivative(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The differentiation matrix of barycentric interpolation."""
    apart = points[:, None] - points[None, :] + np.eye(len(points))
    matrix = weights[None, :] / weights[:, None] / apart
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix


def _interpolation(points: np.ndarray, weights: np.ndarray, at: float) -> np.ndarray:
    """The row that gives a function's value at a point from its values at the nodes."""
    apart = at - points
    if np.any(np.abs(apart) < 1e-14):
        return (np.abs(apart) < 1e-14).astype(float)
    row = weights / apart
    return row / row.sum()


def _refine(loop: Loop, delay: float, s: complex) -> complex | None:
    """The root that Newton's method goes to, None if it goes to none."""
    slopes = {power: polynomial.deriv() for power, polynomial in loop.items()}
    for _ in range(NEWTON_STEPS):
        slope = sum(
            (slopes[power](s) - power * delay * polynomial(s)) * np.exp(-power * delay * s)
            for power, polynomial in loop.items()
        )
        step = delay_function(loop, delay, s) / slope
        s = complex(s - step)
        if abs(step) <= 1e-12 * abs(s):
            return s
    return None
