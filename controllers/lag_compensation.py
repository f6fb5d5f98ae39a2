"""Linear lag compensation: the inverse of one first-order lag.

    u = (τ s + 1)/(τ s/N + 1) r,   discretised by the bilinear (Tustin) transform

Zhao, French, Shield, Posbergh: Considerations for the development of real-time dynamic testing
using servo-hydraulic actuation, Earthquake Eng. Struct. Dyn. 32 (2003) 1773. The law needs only the
lag. It amplifies high frequencies, and noise with them, up to N times.
"""

from __future__ import annotations

import numpy as np

from controllers.linear_law import LinearLaw


def lag_compensation(lag: float, period: float, limit: float = 20.0) -> LinearLaw:
    """Return the law for a lag and a period, s; limit: largest amplification N."""
    # Bilinear: s → 2/T (z − 1)/(z + 1) in (τ s + 1)/(τ s/N + 1).
    rate = 2.0 / period
    lead, filter_ = lag * rate, lag / limit * rate
    ahead = (lead + 1.0) / (filter_ + 1.0)
    behind = (1.0 - lead) / (filter_ + 1.0)
    pole = (filter_ - 1.0) / (filter_ + 1.0)
    return LinearLaw(
        np.array([[pole]]),
        np.array([[1.0, 0.0]]),
        np.array([behind + pole * ahead]),
        np.array([ahead, 0.0]),
    )
