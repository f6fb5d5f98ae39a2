"""Polynomial forward prediction: the command is where the desired motion will be a delay later.

    u(t) = Σ a_i r(t − i h),   exact for polynomials of degree n

Horiuchi, Inoue, Konno, Namita: Real-time hybrid experimental system with actuator delay
compensation, Earthquake Eng. Struct. Dyn. 28 (1999) 1121; there h is the delay itself and n = 3, so
that the weights are 4, −6, 4, −1. Needs the delay alone. It amplifies white noise by √Σ a_i², 8.3
at those weights, and above some 1/(6 h) every motion.
"""

from __future__ import annotations

import numpy as np

from controllers.derivatives import prediction_weights
from controllers.linear_law import LinearLaw, filtered


def forward_prediction(
    delay: float, period: float, degree: int = 3, interval: int | None = None
) -> LinearLaw:
    """The law for a delay and a period in s. interval: ticks between the samples that the
    polynomial goes through; by default those of the delay."""
    ticks = interval or max(1, round(delay / period))
    weights = prediction_weights(delay / (ticks * period), degree + 1)
    spread = np.zeros(degree * ticks + 1)
    spread[::ticks] = weights
    return filtered(spread)
