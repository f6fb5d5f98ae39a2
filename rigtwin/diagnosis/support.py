"""What the confidence in an effect rests on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CALIBRATION = ((0.0, 0.0), (0.5, 0.5), (0.8, 0.8), (0.95, 0.93), (0.999, 0.98), (1.0, 0.98))
"""Probability → confidence. Chosen by hand and close to the diagonal; not fitted to the referees
yet (docs/confidence.md)."""


@dataclass(frozen=True)
class Support:
    """What the confidence in an effect rests on.

    Parameters
    ----------
    probability
        Weight of all hypotheses with this effect.
    margin
        Nats by which the best hypothesis without it, and without what the data cannot tell from it,
        is worse.
    steadiness
        Standard errors by which its magnitude differs from the nominal value.
    remains
        Share of the gap's amplitude that is left in the signals that it acts on.
    dominance
        Amplitude that it alone accounts for, relative to what is left beyond noise and declared
        error in the signals that it acts on; 0.001 to 1000.
    mimic
        Probability that it only resembles something that has no name.
    """

    probability: float
    margin: float
    steadiness: float
    remains: float
    dominance: float
    mimic: float

    @property
    def confidence(self) -> float:
        """Probability that this effect is there, a mimic excluded."""
        said, right = zip(*CALIBRATION, strict=True)
        return float(np.interp(self.probability * (1.0 - self.mimic), said, right))
