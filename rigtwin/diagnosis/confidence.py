"""How sure it is that an effect is there.

The probability of an effect is the weight of all hypotheses that contain it. It holds if the truth
is among them. Where more is left than the model error that was declared, something without a name
acts as well, and what resembles it most is named in its place. Therefore the probability is lowered
by that of a mimic, which grows with the share of the gap that is left. Both are smooth functions.
"""

from __future__ import annotations

import math

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.posterior import Posterior
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.numerics.arrays import Array

STEEPNESS = 4.0
"""Slope of the logistic functions, by the logarithm of a ratio."""


def _logistic(ratio: float) -> float:
    """Probability that grows with the logarithm of a ratio; one half at 1."""
    if ratio <= 0.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-STEEPNESS * math.log(ratio)))


def relative_rest(evidence: Evidence, plant: Plant) -> Array:
    """Residual of each signal beyond its noise, in units of its standard deviation.

    Parameters
    ----------
    evidence
        The recordings.
    plant
        Plant whose predictions are taken.

    Returns
    -------
    array
        Shape (signals,).
    """
    residual, swing = [], []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        counted = lines.fade.max(axis=0) > 0.5
        residual.append(np.mean((lines.measured - predicted)[:, counted] ** 2, axis=1))
        swing.append(np.var(lines.measured[:, counted], axis=1))
    noise = np.mean([lines.noise**2 for lines in evidence.lines], axis=0)
    left = np.maximum(np.mean(residual, axis=0) - noise, 0.0)
    return np.sqrt(left / np.maximum(np.mean(swing, axis=0), 1e-300))


def _dominance(scored: Scored, number: int) -> float:
    """Amplitude of an effect, relative to that of the rest in the signals that it acts on."""
    rest = float(np.sqrt(scored.reach[number] @ scored.rest**2))
    return float(np.clip(scored.accounts[number] / max(rest, 1e-9), 1e-3, 1e3))


def support_of(
    effect: Effect, posterior: Posterior, evidence: Evidence, thresholds: Thresholds
) -> Support:
    """What speaks for an effect of the best hypothesis.

    Parameters
    ----------
    effect
        An effect of the best hypothesis.
    posterior
        All hypotheses.
    evidence
        The recordings.
    thresholds
        Numbers that it goes by.

    Returns
    -------
    Support
        Its probability, and what may be wrong with it.
    """
    best = posterior.best
    number = best.fit.effects.index(effect)
    nominal = effect.nominal(evidence.plant)[effect.kind.parameters[0]]
    width = max(best.widths[number][0], 1e-300)
    reach = best.reach[number]
    rest = float(reach @ relative_rest(evidence, best.fit.plant))
    gap = float(reach @ relative_rest(evidence, evidence.plant))
    remains = min(rest / gap, 1.0) if gap > 0.0 else 0.0
    # A rest within the model error that is expected needs no unnamed effect.
    unnamed = _logistic(rest / evidence.machine.prior.error) * _logistic(
        posterior.rest / thresholds.residual_excess
    )
    return Support(
        probability=posterior.inclusion(effect),
        margin=posterior.margin(effect),
        steadiness=abs(best.fit.values[number][0] - nominal) / width,
        remains=remains,
        dominance=_dominance(best, number),
        mimic=unnamed * _logistic(remains / thresholds.mimicry_share),
    )
