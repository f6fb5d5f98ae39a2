"""Polynomial forward prediction: the command is the desired motion, extrapolated by the delay.

    u(t) = Σ a_i r(t − i h),   exact for polynomials of degree n

Horiuchi, Inoue, Konno, Namita: Real-time hybrid experimental system with actuator delay
compensation, Earthquake Eng. Struct. Dyn. 28 (1999) 1121. There h is the delay itself and n = 3, so
the weights are 4, −6, 4, −1. The law needs only the delay. It amplifies white noise by √Σ a_i²,
8.3 with those weights, and every motion above about 1/(9 h).
"""

from __future__ import annotations

import numpy as np

from controllers.derivatives import prediction_weights
from controllers.linear_law import LinearLaw, filtered


def forward_prediction(
    delay: float, period: float, degree: int = 3, interval: int | None = None
) -> LinearLaw:
    """Return the law for a delay and a period, s.

    degree: of the polynomial; interval: ticks between its samples, by default the delay in ticks.
    """
    ticks = interval or max(1, round(delay / period))
    weights = prediction_weights(delay / (ticks * period), degree + 1)
    spread = np.zeros(degree * ticks + 1)
    spread[::ticks] = weights
    return filtered(spread)
