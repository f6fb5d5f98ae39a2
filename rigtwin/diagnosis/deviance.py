"""Deviance of a hypothesis, and its weight among all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.scoring import Scored
from rigtwin.numerics.arrays import Array


def deviance(levels: Array, pieces: Array, samples: Array, within: float) -> float:
    """Return minus twice the log predictive density, by the module's equation.

    Parameters
    ----------
    levels
        Held-out power q of each band of each signal.
    pieces, samples
        Numbers n of independent samples and N of samples, of the same shape.
    within
        Factor k of gains within noise and declared error.

    Returns
    -------
    float
        Sum over all bands, dimensionless.
    """
    # log1p is precise also for an excess far below 1.
    narrow = samples / np.maximum(pieces, 1e-300)
    excess = np.maximum(levels - 1.0, 0.0)
    return float(np.sum(pieces * (within * np.minimum(levels, 1.0) + np.log1p(excess * narrow))))


@dataclass(frozen=True)
class Weighted:
    """A hypothesis and its weight among all hypotheses that were scored.

    Attributes
    ----------
    scored
        Cross-validated fit of the hypothesis.
    cost
        Minus its score, nats.
    weight
        Posterior weight, 0 to 1. The weights of all hypotheses add up to 1.
    """

    scored: Scored
    cost: float
    weight: float
