"""The smallest lag, and the smallest pure delay, at which a loop stops being stable.

At a frequency ω the characteristic function is a polynomial in z with roots z_k(ω). A pole lies on
the imaginary axis at ω where a root is what z stands for: for a lag 1/z = 1 + jωτ, so Re(1/z) = 1
and τ = Im(1/z)/ω > 0; for a delay z = exp(−jωτ), so |z| = 1 and τ = (−arg z mod 2π)/ω. Either is
one real condition, whose roots in ω are found to rounding error; no step in τ is taken. The highest
power of s stands at z⁰, so poles move continuously from τ = 0 and the smallest τ of all is
critical.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import minimize_scalar, root_scalar

from rigtwin.numerics.arrays import Array
from rigtwin.studies.stability.loop import Loop, Roots, bound, instant, order, roots

POINTS_PER_DECADE = 300
UNDAMPED = 1e-12
"""Of a pole's distance from the origin: a real part above minus this is no damping."""
ACCURACY = 1e-14
"""Of a crossing's frequency."""
MET = 1e-7
"""How far from zero the condition may be at a crossing; where a sign changes through a pole of the
condition it is near 1."""


class Critical(NamedTuple):
    """time: the lag or delay, s; frequency: of the poles that cross there, rad/s."""

    time: float
    frequency: float


def critical_lag(loop: Loop) -> Critical | None:
    """The smallest first-order lag, shared by every power of z, with poles on the imaginary axis; 0
    s if the loop is not stable without any, None if it is stable with every lag."""
    return _smallest(loop, _lag_condition, _lag_times)


def critical_delay(loop: Loop) -> Critical | None:
    """The smallest pure delay, shared by every power of z, with poles on the imaginary axis; 0 s
    and None as for a lag."""
    return _smallest(loop, _delay_condition, _delay_times)


def _lag_condition(inverse: Roots) -> Array:
    """Zero where 1/z = 1 + jωτ; between −1 and 1."""
    return (inverse.real - 1.0) / (1.0 + np.abs(inverse))


def _lag_times(inverse: Roots, frequency: float) -> Array:
    return np.where(inverse.imag > 0.0, inverse.imag / frequency, np.inf)


def _delay_condition(inverse: Roots) -> Array:
    """Zero where |z| = 1; between −1 and 1."""
    size = np.abs(inverse)
    return (size - 1.0) / (size + 1.0)


def _delay_times(inverse: Roots, frequency: float) -> Array:
    return np.mod(np.angle(inverse), 2.0 * np.pi) / frequency


def _smallest(
    loop: Loop,
    condition: Callable[[Roots], Array],
    times: Callable[[Roots, float], Array],
) -> Critical | None:
    poles = roots(instant(loop).coef)
    rightmost = poles[np.argmax(poles.real)]
    if np.any(poles.real >= -UNDAMPED * np.abs(poles)):
        return Critical(0.0, float(abs(rightmost.imag)))
    found = []
    for frequency in _crossings(
        lambda each: np.prod(condition(_inverses(loop, each)), axis=-1),
        _frequencies(loop),
    ):
        inverse = _inverses(loop, np.array([frequency]))[0]
        met = np.abs(condition(inverse)) < MET
        reached = times(inverse, frequency)[met]
        found += [Critical(float(time), frequency) for time in reached if 0.0 < time < np.inf]
    return min(found, default=None)


def _inverses(loop: Loop, frequencies: Array) -> Roots:
    """1/z of every root of the polynomial in z at s = jω, shape (frequencies, order)."""
    highest = order(loop)
    falling = np.zeros((len(frequencies), highest + 1), complex)
    for power, polynomial in loop.items():
        falling[:, highest - power] = polynomial(1j * frequencies)
    # At a frequency of the wheel on an undamped tyre 1/z is infinite; just beside it, it is large.
    falling[:, -1] = np.where(falling[:, -1] == 0.0, 1e-100, falling[:, -1])
    return roots(falling)


def _frequencies(loop: Loop) -> Array:
    """rad/s, a grid that spans every crossing, denser towards the loop's own frequencies."""
    # Roots at s = 0 are no frequencies: the powers of s that a polynomial has in all its terms are
    # divided out.
    polynomials = (*loop.values(), instant(loop))
    trimmed = [Polynomial(np.trim_zeros(each.coef, "f")) for each in polynomials]
    own = np.abs(np.concatenate([polynomial.roots() for polynomial in trimmed]))
    own = own[own > 0.0]
    low, high = np.log10(own.min()) - 3.0, np.log10(max(bound(loop), own.max())) + 0.1
    towards = 0.5 ** np.arange(2, 30)
    near = own[:, None] * np.concatenate([1.0 - towards, 1.0 + towards])
    return np.unique(
        np.concatenate(
            [np.logspace(low, high, int((high - low) * POINTS_PER_DECADE)), near.ravel()],
        ),
    )


def _crossings(function: Callable[[Array], Array], grid: Array) -> list[float]:
    """Where a function of an array changes its sign."""

    def one(at: float) -> float:
        return float(function(np.array([at]))[0])

    values = function(grid)
    signs = np.sign(values)
    brackets = [(grid[i], grid[i + 1]) for i in np.flatnonzero(signs[:-1] * signs[1:] < 0.0)]
    # Two crossings between neighbours leave no change of sign but a dip.
    sizes = np.abs(values)
    smaller = (sizes[1:-1] < sizes[:-2]) & (sizes[1:-1] < sizes[2:])
    dips = smaller & (signs[:-2] == signs[1:-1]) & (signs[1:-1] == signs[2:])
    for i in np.flatnonzero(dips) + 1:
        sign = signs[i]
        dip = minimize_scalar(
            lambda at, sign=sign: sign * one(at),
            bounds=(grid[i - 1], grid[i + 1]),
            method="bounded",
            options={"xatol": 1e-12},
        )
        if sign * one(dip.x) <= 0.0:
            brackets += [(grid[i - 1], dip.x), (dip.x, grid[i + 1])]
    how = {"method": "brentq", "xtol": 1e-300, "rtol": ACCURACY}
    zeros = [root_scalar(one, bracket=each, **how).root for each in brackets]
    return [*map(float, zeros), *grid[signs == 0.0].tolist()]
