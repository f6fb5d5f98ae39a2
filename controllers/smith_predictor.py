"""Smith predictor: feedback through a model of the actuator without its delay.

    u = (K_p + K_i ∫) (r − ŷ_0 − (y − ŷ_θ)),   ŷ_0 = G u,   ŷ_θ = G e^(−θ s) u

The controller acts on the model without delay, and on the part of the measurement that the delayed
model does not explain. Smith: Closer control of loops with dead time, Chem. Eng. Prog. 53 (1957)
217. G is a first-order lag. The law needs the actuator's lag, gain and delay. It removes the delay
from the actuator's loop, but not from the motion, which follows G e^(−θ s) at best.
"""

from __future__ import annotations

import math

import numpy as np

from controllers.linear_law import LinearLaw


def smith_predictor(
    gain: float, lag: float, delay: float, proportional: float, integral: float, period: float
) -> LinearLaw:
    """Return the law for an actuator gain/(lag s + 1) e^(−delay s).

    lag, delay, period: s; proportional: K_p, 1; integral: K_i, 1/s. The model is sampled with the
    command held, and the delay is rounded to whole ticks.
    """
    ticks = max(1, round(delay / period))
    decay = math.exp(-period / lag)
    # States: present model output, those of the last `ticks` ticks, and the integral.
    size = ticks + 2
    a, b, c = np.zeros((size, size)), np.zeros((size, 2)), np.zeros(size)
    error, error_direct = np.zeros(size), np.array([1.0, -1.0])
    # e = r − y − ŷ_0 + ŷ_θ, as a row of the states.
    error[0], error[ticks] = -1.0, 1.0
    c += proportional * error
    c[-1] += 1.0
    d = proportional * error_direct
    a[0], b[0] = gain * (1.0 - decay) * c, gain * (1.0 - decay) * d
    a[0, 0] += decay
    for index in range(1, ticks + 1):
        a[index, index - 1] = 1.0
    a[-1], b[-1] = integral * period * error, integral * period * error_direct
    a[-1, -1] += 1.0
    return LinearLaw(a, b, c, d)
