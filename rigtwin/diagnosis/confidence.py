"""Confidence that an effect is present.

The probability of an effect is the posterior weight of all hypotheses that contain it. It is valid
if the true hypothesis is among them. Where the residual exceeds the model error that was expected,
an unnamed effect acts as well, and the effect that resembles it most may be named in its place.
Therefore the probability is multiplied by 1 - m, where

    m = L(rest / error) L(excess / threshold) L(remains / threshold),
    L(x) = 1 / (1 + x^-s),

is the probability of a mimic, s the steepness of the logistic function L, rest the residual beyond
noise, excess that beyond noise and declared error, and remains the share of the gap that is not
closed. L is smooth, so that no small change of the data turns a confident answer around.

A rare effect may also correct the form of a law: real friction and real springs differ a little
from those of the library, and what differs resembles a small play, compliance or lag. Its mimic has
at least the probability

    1 / (1 + (a / form)^8) · L(clean · remains / a),

where a is the share of the gap's amplitude that returns without the effect, and form the deviation
of a law's form that is expected (`ModelPrior.form`). A true effect explains its part cleanly: with
it, far less remains than it explains.
"""

from __future__ import annotations

import math

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.prices import is_rare
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.numerics.arrays import Array

STEEPNESS = 4.0
"""Exponent s of the logistic functions."""
FORM_STEEPNESS = 8.0
"""Exponent of the logistic function of an effect that may correct the form of a law."""


def _logistic(ratio: float, steepness: float = STEEPNESS) -> float:
    """Return 1 / (1 + ratio^-steepness): 0 at 0, one half at 1."""
    if ratio <= 0.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-steepness * math.log(ratio)))


def relative_rest(evidence: Evidence, plant: Plant) -> Array:
    """Return the residual of each signal beyond its noise, in units of its standard deviation.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    array
        Residual of each signal, shape (signals,).
    """
    residual, swing = [], []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        mean = lines.mean(lines.measured)[:, None]
        residual.append(lines.mean((lines.measured - predicted) ** 2))
        swing.append(lines.mean((lines.measured - mean) ** 2))
    noise = np.mean([lines.noise**2 for lines in evidence.lines], axis=0)
    # Powers of independent parts add, so the noise is subtracted as a power. By chance the residual
    # may have less than its mean.
    beyond = np.maximum(np.mean(residual, axis=0) - noise, 0.0)
    return np.sqrt(beyond / np.maximum(np.mean(swing, axis=0), 1e-300))


def _dominance(scored: Scored, number: int) -> float:
    """Return the amplitude of an effect relative to the residual of the signals it acts on."""
    rest = float(np.sqrt(scored.reach[number] @ scored.rest**2))
    return float(np.clip(scored.accounts[number] / max(rest, 1e-9), 1e-3, 1e3))


def _share_of(effect: Effect, posterior: HypothesisPosterior) -> float:
    """Return the share of the gap's amplitude that returns where an effect is left out.

    Each signal counts by its share in the effect's response: the gap of another joint says nothing
    of the laws of this one. Without the effect, the best hypothesis counts that has no other effect
    in its place.
    """
    reach = posterior.best.reach[posterior.best.fit.effects.index(effect)]
    gap = float(reach @ posterior.excess(posterior.empty))
    remaining = {*posterior.best.fit.effects} - {effect}
    # The ranking is sorted by cost and contains the empty hypothesis, so the first match is the
    # best one and always exists.
    without = next(
        hypothesis.scored
        for hypothesis in posterior.ranking
        if {*hypothesis.scored.fit.effects} <= remaining
    )
    returned = float(reach @ (posterior.excess(without) - posterior.excess(posterior.best)))
    return math.sqrt(max(returned, 0.0) / gap) if gap > 0.0 else 0.0


def _corrects_form(share: float, expected: float, remains: float, clean: float) -> float:
    """Return the probability that a rare effect only corrects the form of the other laws.

    `share` is that of the gap's amplitude that returns without the effect, `remains` that which is
    left with it, `expected` the deviation of a law's form, and `clean` the ratio of both shares at
    which an effect explains its part cleanly.
    """
    # An effect that returns nothing is surely small, and must not divide by zero.
    share = max(share, 1e-9)
    small = _logistic(expected / share, FORM_STEEPNESS)
    return small * _logistic(clean * remains / share)


def support_of(
    effect: Effect, posterior: HypothesisPosterior, evidence: Evidence, thresholds: Thresholds
) -> Support:
    """Return the support of an effect of the best hypothesis.

    Parameters
    ----------
    effect
        Effect of the best hypothesis.
    posterior
        Weights of all hypotheses.
    evidence
        Recordings that are explained.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    Support
        Probability of the effect, and the figures that may lower its confidence.
    """
    best = posterior.best
    number = best.fit.effects.index(effect)
    # Each signal counts by its share in the effect's response.
    reach = best.reach[number]
    rest = float(reach @ relative_rest(evidence, best.fit.plant))
    gap = float(reach @ relative_rest(evidence, evidence.plant))
    remains = min(rest / gap, 1.0) if gap > 0.0 else 0.0
    # A residual within the expected model error needs no unnamed effect.
    unnamed = _logistic(rest / evidence.machine.prior.error) * _logistic(
        posterior.residual_excess / thresholds.residual_excess
    )
    form = 0.0
    if is_rare(effect) and len(best.fit.effects) > 1:
        share, expected = _share_of(effect, posterior), evidence.machine.prior.form
        form = _corrects_form(share, expected, remains, thresholds.clean_ratio)
    resembles = unnamed * _logistic(remains / thresholds.mimicry_share)
    return Support(
        probability=posterior.inclusion(effect),
        margin=posterior.margin(effect),
        steadiness=effect.steadiness(best.fit.values[number], best.widths[number], evidence.plant),
        remains=remains,
        dominance=_dominance(best, number),
        # Both rest on the share of the gap that remains. They are no independent reasons, so the
        # larger one counts and not their product or sum.
        mimic=max(resembles, form),
    )
