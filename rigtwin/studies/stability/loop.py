"""The characteristic function of a loop, a polynomial in s and z; z stands for one lag 1/(1 + τ s)
or one delay exp(−τ s).

Single mass: m s² + z (k + b s). Quarter car, with N = k_s + b_s s, W = m_u s² + b_t s + k_t and f
the force of the suspension: W x_u = f, m_s s² x_s = −f, f = z_force N (z_structure x_s − x_u), so
that

    m_s s² W + z_force N (z_structure W + m_s s²) = 0.

A loop is kept as power of z → polynomial in s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.polynomial import Polynomial

from rigtwin.studies.stability.vehicle import QuarterCar, SingleMass, validate

Loop = Mapping[int, Polynomial]
"""Power of z → polynomial in s."""
Roots = np.ndarray
"""Complex numbers, 1/s."""


def single_mass(mass: SingleMass, lags: int = 1) -> Loop:
    """The loop of a single mass whose force comes through that many lags or delays in series (Eq.
    5.17, §5.1.6)."""
    validate(mass)
    return {0: Polynomial([0.0, 0.0, mass.mass]), lags: Polynomial([mass.stiffness, mass.damping])}


def quarter_car(car: QuarterCar, force: int, structure: int) -> Loop:
    """The loop of a quarter car. force, structure: how many lags or delays the suspension's force
    and the sprung mass's motion come through."""
    validate(car)
    sprung = Polynomial([0.0, 0.0, car.sprung_mass])
    wheel = Polynomial([car.tyre_stiffness, car.tyre_damping, car.unsprung_mass])
    suspension = Polynomial([car.suspension_stiffness, car.suspension_damping])
    loop: dict[int, Polynomial] = {0: sprung * wheel}
    for power, term in ((force, suspension * sprung), (force + structure, suspension * wheel)):
        loop[power] = loop[power] + term if power in loop else term
    return loop


LOOPS: Mapping[str, Callable[[QuarterCar], Loop]] = {
    "single-mass": lambda car: single_mass(car.sprung),
    "suspension": lambda car: quarter_car(car, force=1, structure=0),
    "structure": lambda car: quarter_car(car, force=0, structure=1),
    "combined": lambda car: quarter_car(car, force=1, structure=1),
    "rig": lambda car: quarter_car(car, force=2, structure=1),
}
"""Model → its loop, all lags or delays equal. Those of the rig (§6.2): force; travel and velocity,
which come in parallel and count once; plate."""


def order(loop: Loop) -> int:
    """The highest power of z."""
    return max(loop)


def instant(loop: Loop) -> Polynomial:
    """The characteristic polynomial without any lag or delay, z = 1."""
    return lag_polynomial(loop, 0.0)


def lag_polynomial(loop: Loop, lag: float) -> Polynomial:
    """The characteristic polynomial with z = 1/(1 + lag s), times (1 + lag s) to the highest power.
    lag: s."""
    factor, highest = Polynomial([1.0, lag]), order(loop)
    terms = [polynomial * factor ** (highest - power) for power, polynomial in loop.items()]
    return sum(terms[1:], terms[0])


def delay_function(loop: Loop, delay: float, s: complex) -> complex:
    """The characteristic function with z = exp(−delay s) at s. delay: s."""
    return complex(
        sum(polynomial(s) * np.exp(-power * delay * s) for power, polynomial in loop.items()),
    )


def roots(coefficients: np.ndarray) -> Roots:
    """The roots of polynomials of one degree, their coefficients in ascending powers on the last
    axis."""
    degree = coefficients.shape[-1] - 1
    companions = np.zeros((*coefficients.shape[:-1], degree, degree), coefficients.dtype)
    companions[..., np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companions[..., :, -1] = -coefficients[..., :-1] / coefficients[..., -1:]
    return np.linalg.eigvals(companions).astype(complex)


def lag_roots(loop: Loop, lag: float) -> Roots:
    """The poles of a loop with lags, s."""
    return roots(lag_polynomial(loop, lag).coef)


def bound(loop: Loop) -> float:
    """1/s. No root with a real part of 0 or more is further from the origin, whatever the lag or
    the delay: there |z| ≤ 1, and beyond this the highest power of s outweighs all else together."""
    own = np.abs(loop[0].coef)
    rest = np.zeros(len(own))
    for each in (
        own[:-1],
        *(np.abs(polynomial.coef) for power, polynomial in loop.items() if power),
    ):
        rest[: len(each)] -= each
    rest[-1] += own[-1]
    return float(Polynomial(rest).roots().real.max())
