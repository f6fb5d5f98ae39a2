"""Rightmost root of a loop with pure delays, whose characteristic function has infinitely many."""

from __future__ import annotations

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.loop import Loop, Roots, bound, delay_function, instant, order
from rigtwin.studies.stability.vehicle import check_time

MIN_NODES, MAX_NODES = 20, 160
"""Range of the number of Chebyshev nodes over the longest delay, less one. The minimum provides
accuracy; a fast oscillation over the delay needs more."""
CANDIDATES = 24
NEWTON_STEPS = 50
"""Maximum number of Newton steps per root."""


def rightmost_delay_root(loop: Loop, delay: float) -> complex:
    """Return the rightmost root with z = exp(−delay s), in 1/s.

    Of a complex pair the root with positive frequency is returned. The infinitesimal generator of
    the delay differential equation is discretised at Chebyshev nodes (Breda, Maset and Vermiglio,
    SIAM Journal on Scientific Computing 27(2), 2005). Newton's method then refines its rightmost
    eigenvalues on the characteristic function itself.

    Parameters
    ----------
    loop
        Characteristic function of the loop.
    delay
        Delay of one power of z, in s.
    """
    check_time("delay", delay)
    # An oscillation at the bound's frequency needs about half a node per radian of phase.
    span = delay * order(loop)
    nodes = int(min(MIN_NODES + 0.5 * bound(loop) * span, MAX_NODES))
    eigenvalues = _generator_eigenvalues(loop, delay, nodes)
    # Only the rightmost candidates are refined; Newton's method removes the discretisation's error.
    rightmost = eigenvalues[np.argsort(-eigenvalues.real)][:CANDIDATES]
    refined = (_refine(loop, delay, start) for start in rightmost)
    converged = [root for root in refined if root is not None]
    if not converged:
        raise RigtwinError(
            f"no root found with a delay of {delay:g} s: expected a loop of bounded frequencies"
        )
    best = max(converged, key=lambda root: root.real)
    return complex(best.real, abs(best.imag))


def _generator_eigenvalues(loop: Loop, delay: float, nodes: int) -> Roots:
    # Time is scaled by the mean magnitude of the loop's roots, so that all derivatives of the state
    # are of similar size and the eigenvalues are well conditioned.
    scale = float(np.exp(np.mean(np.log(np.abs(instant(loop).roots())))))
    degree = loop[0].degree()
    powers = scale ** np.arange(degree + 1)
    leading = loop[0].coef[-1] * powers[-1]
    longest = scale * delay * order(loop)
    # Nodes from cos 0 = 1, the present, to cos π = −1, the longest delay ago.
    angles = np.pi * np.arange(nodes + 1) / nodes
    points = np.cos(angles)
    # Barycentric weights of Chebyshev nodes of the second kind: ±1, halved at both ends.
    weights = (-1.0) ** np.arange(nodes + 1) * np.where(
        (angles == 0.0) | (np.arange(nodes + 1) == nodes), 0.5, 1.0
    )
    # The derivative along the past: d/dθ of the state history, for each of its components.
    generator = np.kron(_derivative(points, weights) * (2.0 / longest), np.eye(degree))
    # The first block row is the splicing condition: the delay equation itself at the present.
    generator[:degree] = 0.0
    generator[: degree - 1, 1:degree] = np.eye(degree - 1)
    # The last block row is the delay equation: the highest derivative at present is a sum over past
    # states, interpolated at each multiple of the delay.
    for power, polynomial in loop.items():
        coefficients = np.zeros(degree + 1)
        coefficients[: len(polynomial.coef)] = polynomial.coef
        # A delay of `power` lags lies at this place between the present, 1, and the longest
        # delay, −1.
        at = _interpolation(points, weights, 1.0 - 2.0 * power / order(loop))
        generator[degree - 1] -= np.kron(at, (coefficients * powers / leading)[:degree])
    return scale * np.linalg.eigvals(generator)


def _derivative(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the differentiation matrix of barycentric interpolation (Berrut, Trefethen 2004)."""
    distances = points[:, None] - points[None, :] + np.eye(len(points))
    matrix = weights[None, :] / weights[:, None] / distances
    np.fill_diagonal(matrix, 0.0)
    # Rows sum to zero, because the derivative of a constant is zero.
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix


def _interpolation(points: np.ndarray, weights: np.ndarray, at: float) -> np.ndarray:
    """Return the row that interpolates a function at a point from its values at the nodes."""
    distances = at - points
    if np.any(np.abs(distances) < 1e-14):
        return (np.abs(distances) < 1e-14).astype(float)
    row = weights / distances
    return row / row.sum()


def _refine(loop: Loop, delay: float, s: complex) -> complex | None:
    """Return the root Newton's method converges to, or None without convergence."""
    slopes = {power: polynomial.deriv() for power, polynomial in loop.items()}
    for _ in range(NEWTON_STEPS):
        # d/ds of Σ p_k(s) e^{−kτs}: each term gives (p_k′ − k τ p_k) e^{−kτs}.
        slope = sum(
            (slopes[power](s) - power * delay * polynomial(s)) * np.exp(-power * delay * s)
            for power, polynomial in loop.items()
        )
        step = delay_function(loop, delay, s) / slope
        s = complex(s - step)
        if abs(step) <= 1e-12 * abs(s):
            return s
    return None
