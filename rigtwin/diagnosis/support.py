"""Support of a named effect: the figures on which its confidence rests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CALIBRATION = ((0.0, 0.0), (0.5, 0.5), (0.8, 0.8), (0.95, 0.93), (0.999, 0.98), (1.0, 0.98))
"""Pairs of probability and confidence, interpolated linearly. They are chosen by hand close to the
diagonal, and not fitted to the referees yet (docs/confidence.md)."""


@dataclass(frozen=True)
class Support:
    """Figures on which the confidence in an effect rests.

    Attributes
    ----------
    probability
        Weight of all hypotheses with this effect, 0 to 1.
    margin
        Nats by which the best hypothesis without the effect and its rivals is worse.
    steadiness
        Standard errors by which the effect's magnitude differs from its nominal value.
    remains
        Share of the gap's amplitude that remains in the signals on which the effect acts.
    dominance
        Amplitude that the effect accounts for, relative to the residual beyond noise and declared
        error in the signals on which it acts; 0.001 to 1000.
    mimic
        Probability that the effect only resembles an unnamed effect, or corrects a law's form.
    """

    probability: float
    margin: float
    steadiness: float
    remains: float
    dominance: float
    mimic: float

    @property
    def confidence(self) -> float:
        """Calibrated probability that the effect is present and is no mimic."""
        # The mimic is a separate reason to doubt, so its complement multiplies the weight before
        # the calibration.
        probabilities, confidences = zip(*CALIBRATION, strict=True)
        likely = self.probability * (1.0 - self.mimic)
        return float(np.interp(likely, probabilities, confidences))
