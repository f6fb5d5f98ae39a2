"""Critical lag and critical delay: the smallest at which a loop loses stability.

At a frequency ω the characteristic function is a polynomial in z with roots z_k(ω). A pole lies on
the imaginary axis at ω if a root equals the lag or delay that z represents:

    lag      1/z = 1 + jωτ      so Re(1/z) = 1   and τ = Im(1/z)/ω > 0
    delay    z = exp(−jωτ)      so |z| = 1       and τ = (−arg z mod 2π)/ω

Either is one real condition in ω. Its roots are found to rounding error, without a step in τ. The
coefficient of the highest power of s belongs to z⁰, so poles move continuously from τ = 0, and the
smallest τ of all is critical.
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
"""Relative real part, in shares of the pole's magnitude, above which a pole counts as undamped."""
ACCURACY = 1e-14
"""Relative accuracy of a crossing's frequency."""
MET = 1e-7
"""Largest value of the condition at a true crossing. At a sign change through a pole of the
condition its value is near 1."""


class Critical(NamedTuple):
    """Critical time and the frequency of the poles that cross.

    Attributes
    ----------
    time
        Lag or delay, in s.
    frequency
        Frequency of the crossing poles, in rad/s.
    """

    time: float
    frequency: float


def critical_lag(loop: Loop) -> Critical | None:
    """Return the critical first-order lag, shared by every power of z.

    The time is 0 s if the loop is unstable without any lag. None if it is stable with every lag.
    """
    return _smallest(loop, _lag_condition, _lag_times)


def critical_delay(loop: Loop) -> Critical | None:
    """Return the critical pure delay, shared by every power of z.

    The time is 0 s if the loop is unstable without delay. None if it is stable with every delay.
    """
    return _smallest(loop, _delay_condition, _delay_times)


def _lag_condition(inverse: Roots) -> Array:
    """Return a value between −1 and 1 that is zero where 1/z = 1 + jωτ."""
    # Re(1/z) = 1, bounded by the size of 1/z so that a root at infinity gives no overflow.
    return (inverse.real - 1.0) / (1.0 + np.abs(inverse))


def _lag_times(inverse: Roots, frequency: float) -> Array:
    return np.where(inverse.imag > 0.0, inverse.imag / frequency, np.inf)


def _delay_condition(inverse: Roots) -> Array:
    """Return a value between −1 and 1 that is zero where |z| = 1."""
    size = np.abs(inverse)
    return (size - 1.0) / (size + 1.0)


def _delay_times(inverse: Roots, frequency: float) -> Array:
    return np.mod(np.angle(inverse), 2.0 * np.pi) / frequency


def _smallest(
    loop: Loop, condition: Callable[[Roots], Array], times: Callable[[Roots, float], Array]
) -> Critical | None:
    # A loop that is unstable without any lag has the critical time 0.
    poles = roots(instant(loop).coef)
    rightmost = poles[np.argmax(poles.real)]
    if np.any(poles.real >= -UNDAMPED * np.abs(poles)):
        return Critical(0.0, float(abs(rightmost.imag)))
    candidates = []
    # The product over all branches changes its sign where any one branch meets the condition.
    for frequency in _crossings(
        lambda frequencies: np.prod(condition(_inverses(loop, frequencies)), axis=-1),
        _frequencies(loop),
    ):
        inverse = _inverses(loop, np.array([frequency]))[0]
        met = np.abs(condition(inverse)) < MET
        reached = times(inverse, frequency)[met]
        candidates += [Critical(float(time), frequency) for time in reached if 0.0 < time < np.inf]
    return min(candidates, default=None)


def _inverses(loop: Loop, frequencies: Array) -> Roots:
    """Return 1/z of every root of the polynomial in z at s = jω, shape (frequencies, order)."""
    highest = order(loop)
    falling = np.zeros((len(frequencies), highest + 1), complex)
    for power, polynomial in loop.items():
        falling[:, highest - power] = polynomial(1j * frequencies)
    # At the frequency of a wheel on an undamped tyre 1/z is infinite; a tiny coefficient keeps it
    # large and finite.
    falling[:, -1] = np.where(falling[:, -1] == 0.0, 1e-100, falling[:, -1])
    return roots(falling)


def _frequencies(loop: Loop) -> Array:
    """Return a frequency grid, in rad/s, that spans all crossings and is dense at resonances."""
    # Roots at s = 0 are no resonances: a common power of s is divided out of each polynomial.
    polynomials = (*loop.values(), instant(loop))
    # Coefficients rise with the power of s, so zeros at the front are roots at s = 0.
    trimmed = [Polynomial(np.trim_zeros(polynomial.coef, "f")) for polynomial in polynomials]
    resonances = np.abs(np.concatenate([polynomial.roots() for polynomial in trimmed]))
    resonances = resonances[resonances > 0.0]
    # Three decades below the slowest resonance the loop is its own static limit.
    low = np.log10(resonances.min()) - 3.0
    high = np.log10(max(bound(loop), resonances.max())) + 0.1
    # Distances to a resonance halve, because crossings crowd there when damping is small.
    towards = 0.5 ** np.arange(2, 30)
    near = resonances[:, None] * np.concatenate([1.0 - towards, 1.0 + towards])
    return np.unique(
        np.concatenate(
            [np.logspace(low, high, int((high - low) * POINTS_PER_DECADE)), near.ravel()]
        )
    )


def _crossings(function: Callable[[Array], Array], grid: Array) -> list[float]:
    """Return the zeros of a function of an array, bracketed on a grid."""

    def value_at(point: float) -> float:
        return float(function(np.array([point]))[0])

    # The grid brackets simple crossings; pairs of crossings are found below.
    values = function(grid)
    signs = np.sign(values)
    brackets = [(grid[i], grid[i + 1]) for i in np.flatnonzero(signs[:-1] * signs[1:] < 0.0)]
    # Two crossings between neighbouring points leave no change of sign, only a dip.
    sizes = np.abs(values)
    smaller = (sizes[1:-1] < sizes[:-2]) & (sizes[1:-1] < sizes[2:])
    dips = smaller & (signs[:-2] == signs[1:-1]) & (signs[1:-1] == signs[2:])
    for i in np.flatnonzero(dips) + 1:
        sign = signs[i]
        dip = minimize_scalar(
            lambda at, sign=sign: sign * value_at(at),
            bounds=(grid[i - 1], grid[i + 1]),
            method="bounded",
            options={"xatol": 1e-12},
        )
        if sign * value_at(dip.x) <= 0.0:
            brackets += [(grid[i - 1], dip.x), (dip.x, grid[i + 1])]
    # An absolute tolerance of about zero leaves the relative one to decide at low frequencies.
    options = {"method": "brentq", "xtol": 1e-300, "rtol": ACCURACY}
    zeros = [root_scalar(value_at, bracket=bracket, **options).root for bracket in brackets]
    return [*map(float, zeros), *grid[signs == 0.0].tolist()]
