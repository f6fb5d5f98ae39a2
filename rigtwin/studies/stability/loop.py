"""Characteristic function of a loop: a polynomial in s and z.

z represents one lag 1/(1 + τ s) or one delay exp(−τ s). A single mass has m s² + z (k + b s). For a
quarter car let N = k_s + b_s s, W = m_u s² + b_t s + k_t, and f the suspension force. Then
W x_u = f, m_s s² x_s = −f and f = z_force N (z_structure x_s − x_u), so that

    m_s s² W + z_force N (z_structure W + m_s s²) = 0.

A loop is stored as a mapping from the power of z to its polynomial in s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.polynomial import Polynomial

from rigtwin.studies.stability.vehicle import QuarterCar, SingleMass, validate

Loop = Mapping[int, Polynomial]
"""Mapping from the power of z to its polynomial in s."""
Roots = np.ndarray
"""Complex array of roots, in 1/s."""


def single_mass(mass: SingleMass, lags: int = 1) -> Loop:
    """Return the loop of a single mass (Eq. 5.17, §5.1.6).

    Parameters
    ----------
    mass
        Mass on a spring and a damper.
    lags
        Number of lags or delays in series in the path of the force.
    """
    validate(mass)
    return {0: Polynomial([0.0, 0.0, mass.mass]), lags: Polynomial([mass.stiffness, mass.damping])}


def quarter_car(car: QuarterCar, force: int, structure: int) -> Loop:
    """Return the loop of a quarter car.

    Parameters
    ----------
    car
        The vehicle.
    force
        Number of lags or delays in the path of the suspension's force.
    structure
        Number of lags or delays in the path of the sprung mass's motion.
    """
    validate(car)
    sprung = Polynomial([0.0, 0.0, car.sprung_mass])
    wheel = Polynomial([car.tyre_stiffness, car.tyre_damping, car.unsprung_mass])
    suspension = Polynomial([car.suspension_stiffness, car.suspension_damping])
    loop: dict[int, Polynomial] = {0: sprung * wheel}
    # Without a lag of the structure both terms have the same power of z, and add up.
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
"""Model → its loop with equal lags or delays. The rig's paths (§6.2) are: the force; travel and its
velocity, which are parallel and count once; and the plate."""


def order(loop: Loop) -> int:
    """Return the highest power of z."""
    return max(loop)


def instant(loop: Loop) -> Polynomial:
    """Return the characteristic polynomial without lag or delay, z = 1."""
    return lag_polynomial(loop, 0.0)


def lag_polynomial(loop: Loop, lag: float) -> Polynomial:
    """Return the characteristic polynomial with z = 1/(1 + lag s), lag in s.

    The polynomial is multiplied by (1 + lag s) to the highest power of z.
    """
    factor, highest = Polynomial([1.0, lag]), order(loop)
    terms = [polynomial * factor ** (highest - power) for power, polynomial in loop.items()]
    return sum(terms[1:], terms[0])


def delay_function(loop: Loop, delay: float, s: complex) -> complex:
    """Return the characteristic function at s, with z = exp(−delay s) and the delay in s."""
    return complex(
        sum(polynomial(s) * np.exp(-power * delay * s) for power, polynomial in loop.items())
    )


def roots(coefficients: np.ndarray) -> Roots:
    """Return the roots of several polynomials of the same degree.

    Parameters
    ----------
    coefficients
        Coefficients in ascending powers, shape (..., degree + 1).
    """
    # Roots are the eigenvalues of the companion matrix; eigvals takes a whole stack of them.
    degree = coefficients.shape[-1] - 1
    companions = np.zeros((*coefficients.shape[:-1], degree, degree), coefficients.dtype)
    companions[..., np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companions[..., :, -1] = -coefficients[..., :-1] / coefficients[..., -1:]
    return np.linalg.eigvals(companions).astype(complex)


def bound(loop: Loop) -> float:
    """Return a bound on the magnitude of all unstable roots, in 1/s.

    The bound holds for every lag and delay: in the right half plane |z| ≤ 1, so beyond the bound
    the highest power of s exceeds the sum of all remaining terms.
    """
    # Cauchy's bound: the positive root of |a_n| s^n − Σ |a_k| s^k, with the terms of all powers
    # of z added up.
    leading = np.abs(loop[0].coef)
    margin = np.zeros(len(leading))
    for magnitudes in (
        leading[:-1],
        *(np.abs(polynomial.coef) for power, polynomial in loop.items() if power),
    ):
        margin[: len(magnitudes)] -= magnitudes
    margin[-1] += leading[-1]
    return float(Polynomial(margin).roots().real.max())
