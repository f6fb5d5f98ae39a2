"""Inverse model: what the actuator needs to follow, by its inverse from the desired motion's
derivatives, and what remains by feedback of the error.

    u = c_0 r + c_1 r' + ... + c_n r^(n) + K_p e + K_i ∫ e dt,   e = r − y

c are the coefficients of the inverse 1/P(s), cut off at n. Carrion, Spencer: Model-based strategies
for real-time hybrid testing, NSEL Report 6, University of Illinois (2007); Phillips, Spencer:
Model-based multiactuator control for real-time hybrid simulation, J. Eng. Mech. 139 (2013) 219.
Needs the actuator's transfer function. White noise on r is amplified by about c_n T^−n.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controllers.derivatives import derivative_weights
from controllers.linear_law import LinearLaw, add_feedback, filtered


def inverse_model(
    coefficients: Sequence[float],
    period: float,
    proportional: float = 0.0,
    integral: float = 0.0,
) -> LinearLaw:
    """The law of the inverse's coefficients, of s⁰ upwards (s^i each), the feedback's gains (1,
    1/s) and the period, s."""
    points = len(coefficients) + 1
    weights = np.zeros(points)
    for order, coefficient in enumerate(coefficients):
        weights += coefficient * derivative_weights(order, points, period)
    return add_feedback(filtered(weights), proportional, integral, period)


def inverse_coefficients(
    numerator: Sequence[float], denominator: Sequence[float], delay: float, order: int
) -> list[float]:
    """Taylor coefficients of s⁰ to s^order of 1/P for P = e^(−delay s) numerator/denominator, both
    from the highest power down; delay: s."""
    below = np.zeros(order + 1)
    above = np.zeros(order + 1)
    for into, polynomial in ((below, numerator), (above, denominator)):
        rising = np.asarray(polynomial, dtype=float)[::-1][: order + 1]
        into[: len(rising)] = rising
    steps = np.cumprod([1.0, *(delay / power for power in range(1, order + 1))])
    above = np.convolve(above, steps)[: order + 1]
    found: list[float] = []
    for power in range(order + 1):
        known = sum(below[power - i] * found[i] for i in range(power))
        found.append(float((above[power] - known) / below[0]))
    return found
