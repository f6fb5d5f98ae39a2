"""Inverse model: feedforward by the actuator's inverse, and feedback of the remaining error.

    u = c_0 r + c_1 r' + ... + c_n r^(n) + K_p e + K_i ∫ e dt,   e = r − y

c are the Taylor coefficients of the inverse 1/P(s), up to order n. Carrion, Spencer: Model-based
strategies for real-time hybrid testing, NSEL Report 6, University of Illinois (2007); Phillips,
Spencer: Model-based multiactuator control for real-time hybrid simulation, J. Eng. Mech. 139 (2013)
219.

The law needs the actuator's transfer function. It amplifies white noise on r by about
κ_n c_n T^−n, with κ = 2.5, 6.8, 16.8 for n = 1, 2, 3 of the backward differences used here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controllers.derivatives import derivative_weights
from controllers.linear_law import LinearLaw, add_feedback, filtered


def inverse_model(
    coefficients: Sequence[float], period: float, proportional: float = 0.0, integral: float = 0.0
) -> LinearLaw:
    """Return the law of an inverse with feedback.

    coefficients: of the inverse, in ascending powers of the Laplace variable, coefficient i in
    seconds to the power i; proportional, integral: gains of the feedback, 1 and 1/s; period: s.
    """
    points = len(coefficients) + 1
    weights = np.zeros(points)
    for order, coefficient in enumerate(coefficients):
        weights += coefficient * derivative_weights(order, points, period)
    return add_feedback(filtered(weights), proportional, integral, period)


def inverse_coefficients(
    numerator: Sequence[float], denominator: Sequence[float], delay: float, order: int
) -> list[float]:
    """Return the Taylor coefficients of 1/P in ascending powers of the Laplace variable.

    P = e^(−delay s) numerator/denominator, both polynomials from the highest power down; delay: s.
    """
    divisor = np.zeros(order + 1)
    dividend = np.zeros(order + 1)
    for series, polynomial in ((divisor, numerator), (dividend, denominator)):
        rising = np.asarray(polynomial, dtype=float)[::-1][: order + 1]
        series[: len(rising)] = rising
    # 1/P = e^(delay s) denominator/numerator; e^(θ s) = Σ θ^k s^k/k!.
    exponential = np.cumprod([1.0, *(delay / power for power in range(1, order + 1))])
    dividend = np.convolve(dividend, exponential)[: order + 1]
    coefficients: list[float] = []
    for power in range(order + 1):
        # Long division of power series: numerator · result = denominator · e^(θ s).
        known = sum(divisor[power - i] * coefficients[i] for i in range(power))
        coefficients.append(float((dividend[power] - known) / divisor[0]))
    return coefficients
