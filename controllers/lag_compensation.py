"""Linear lag compensation: the inverse of one first-order lag.

    u = (τ s + 1)/(τ s/N + 1) r,   bilinear

Zhao, French, Shield, Posbergh: Considerations for the development of real-time dynamic testing
using servo-hydraulic actuation, Earthquake Eng. Struct. Dyn. 32 (2003) 1773. Needs the lag alone.
High frequencies, and so noise, are amplified up to N times.
"""

from __future__ import annotations

import numpy as np

from controllers.linear_law import LinearLaw


def lag_compensation(lag: float, period: float, limit: float = 20.0) -> LinearLaw:
    """The law for a lag and a period in s. limit: N, the most that a high frequency is amplified
    by."""
    rate = 2.0 / period
    lead, filter_ = lag * rate, lag / limit * rate
    ahead, behind, pole = (
        (lead + 1.0) / (filter_ + 1.0),
        (1.0 - lead) / (filter_ + 1.0),
        (filter_ - 1.0) / (filter_ + 1.0),
    )
    return LinearLaw(
        np.array([[pole]]),
        np.array([[1.0, 0.0]]),
        np.array([behind + pole * ahead]),
        np.array([ahead, 0.0]),
    )
