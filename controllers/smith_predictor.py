"""Smith predictor: feedback as if the actuator had no delay.

    u = (K_p + K_i ∫) (r − ŷ_0 − (y − ŷ_θ)),   ŷ_0 = G u,   ŷ_θ = G e^(−θ s) u

The controller sees the model without delay, and of the measurement only what the model with delay
does not explain. Smith: Closer control of loops with dead time, Chem. Eng. Prog. 53 (1957) 217.
Needs the actuator's lag, gain and delay; it takes the delay out of the actuator's loop, not out of
the motion, which follows G e^(−θ s) at best. G is one first-order lag.
"""

from __future__ import annotations

import math

import numpy as np

from controllers.linear_law import LinearLaw


def smith_predictor(
    gain: float, lag: float, delay: float, proportional: float, integral: float, period: float
) -> LinearLaw:
    """The law for an actuator gain/(lag s + 1) e^(−delay s); lag, delay, period: s; K_p: 1, K_i:
    1/s.

    The model is sampled with the command held; the delay is rounded to whole ticks.
    """
    ticks = max(1, round(delay / period))
    decay = math.exp(-period / lag)
    # States: the model's outputs of now and of the last `ticks` ticks, the integral.
    size = ticks + 2
    a, b, c = np.zeros((size, size)), np.zeros((size, 2)), np.zeros(size)
    error, error_direct = np.zeros(size), np.array([1.0, -1.0])
    error[0], error[ticks] = -1.0, 1.0
    c += proportional * error
    c[-1] += 1.0
    d = proportional * error_direct
    a[0], b[0] = gain * (1.0 - decay) * c, gain * (1.0 - decay) * d
    a[0, 0] += decay
    for place in range(1, ticks + 1):
        a[place, place - 1] = 1.0
    a[-1], b[-1] = integral * period * error, integral * period * error_direct
    a[-1, -1] += 1.0
    return LinearLaw(a, b, c, d)
