"""Cross-validation of a correction: how far it shrinks the gap on data it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, with_values
from rigtwin.diagnosis.gap import Interval
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.shrinkage import Blocks, blocks, interval, largest_shrinkage, mean_shrinkage
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

Effects = tuple[Effect, ...]


@dataclass(frozen=True)
class Validation:
    """Effect of a correction on data held out of its fit.

    Attributes
    ----------
    predicted
        Share of the gap that the correction closes on the data of the fit.
    held_out
        Share that it closes on held-out data.
    accepted
        Effects that do not make held-out data worse.
    rejected
        Effects that make held-out data worse.
    data
        Description of the held-out data.
    largest
        Share that the accepted effects close in the signal where they close most.
    measurable
        Whether the power over all signals exceeds noise and declared error before the correction.
        A gap within a narrow band may not raise it, and yet be significant in that band.
    """

    predicted: float
    held_out: Interval
    accepted: Effects
    rejected: Effects
    data: str
    largest: float
    measurable: bool


def validate(
    evidence: Evidence,
    fit: Fit,
    named: Effects,
    posterior: HypothesisPosterior,
    held_out: Evidence | None = None,
    thresholds: Thresholds = STANDARD,
) -> Validation:
    """Judge a correction on data held out of its fit.

    Parameters
    ----------
    evidence
        Evidence of the fit.
    fit
        Best hypothesis.
    named
        Effects of the fit that are named.
    posterior
        Cross-validation of the fit, used where there are no held-out recordings.
    held_out
        Evidence of recordings held out of the fit. Defaults to the blocks held out in turn.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    Validation
        Shrinkage of the gap, and the effects that are accepted and rejected.
    """
    corrected = with_effects(evidence.plant, fit, named)
    inside = blocks(evidence, evidence.plant, corrected)
    if held_out is None:
        return _validate_on_blocks(evidence, corrected, inside, named, posterior)
    return _validate_on_recordings(evidence, fit, inside, named, held_out, thresholds)


def _validate_on_blocks(
    evidence: Evidence,
    corrected: Plant,
    inside: Blocks,
    named: Effects,
    posterior: HypothesisPosterior,
) -> Validation:
    """Judge a correction on the blocks that were held out of its fit in turn.

    The residual of the fit is scaled by its optimism: the ratio of the held-out power of the best
    hypothesis to its fitted power. No effect is rejected, as the search has judged it by the same
    blocks.
    """
    best = posterior.best
    outside, fitted = (float(np.sum(part * best.samples)) for part in (best.levels, best.inside))
    # A ratio below 1, blocks predicted better than they were fitted, is luck and no merit.
    optimism = max(outside / max(fitted, 1e-300), 1.0)
    scaled = Blocks(inside.before, inside.after * optimism, inside.floor)
    return Validation(
        predicted=mean_shrinkage(inside),
        held_out=interval(scaled),
        accepted=named,
        rejected=(),
        data="blocks left out of the fit in turn",
        largest=largest_shrinkage(evidence, evidence.plant, corrected, optimism),
        measurable=_is_measurable(inside),
    )


def _validate_on_recordings(
    evidence: Evidence,
    fit: Fit,
    inside: Blocks,
    named: Effects,
    held_out: Evidence,
    thresholds: Thresholds,
) -> Validation:
    """Judge a correction on held-out recordings, and reject the effects that make them worse."""

    def correct_with(effects: Effects) -> Blocks:
        return blocks(held_out, evidence.plant, with_effects(evidence.plant, fit, effects))

    count = len(held_out.recordings)
    accepted, rejected = reject_worsening(named, correct_with, thresholds.worsening_factor)
    corrected = with_effects(evidence.plant, fit, accepted)
    outside = correct_with(accepted)
    return Validation(
        predicted=mean_shrinkage(inside),
        held_out=interval(outside),
        accepted=accepted,
        rejected=rejected,
        data=f"{count} held-out recording{'s' if count > 1 else ''}",
        largest=largest_shrinkage(held_out, evidence.plant, corrected),
        measurable=_is_measurable(outside),
    )


def _is_measurable(residual: Blocks) -> bool:
    """Return whether the power before the correction exceeds noise and declared error."""
    return bool(len(residual.before)) and float(residual.before.mean()) > residual.floor


def with_effects(plant: Plant, fit: Fit, accepted: Sequence[Effect]) -> Plant:
    """Set the accepted effects of a fit in a plant.

    Parameters
    ----------
    plant
        Plant without the effects.
    fit
        Fit with the effects' values.
    accepted
        Effects to set. Effects that are not part of the fit are ignored.

    Returns
    -------
    Plant
        The plant with these effects.
    """
    pairs = [
        (effect, values)
        for effect, values in zip(fit.effects, fit.values, strict=True)
        if effect in accepted
    ]
    return with_values(plant, [effect for effect, _ in pairs], [values for _, values in pairs])


def reject_worsening(
    effects: Effects,
    correct_with: Callable[[Effects], Blocks],
    factor: float = STANDARD.worsening_factor,
) -> tuple[Effects, Effects]:
    """Reject effects that make held-out data worse.

    Parameters
    ----------
    effects
        Effects of a correction.
    correct_with
        Function that returns the residual of held-out data corrected with some of the effects.
    factor
        Factor of the residual's power above which an effect is rejected.

    Returns
    -------
    tuple
        Accepted and rejected effects.
    """
    accepted = effects
    while accepted:
        corrected = correct_with(accepted)
        if not len(corrected.after):
            break
        # One effect is rejected at a time, the worst first: a wrong effect may make others that are
        # right look harmful beside it.
        without = {
            effect: correct_with(tuple(member for member in accepted if member != effect))
            for effect in accepted
        }
        worst = min(accepted, key=lambda effect: float(without[effect].after.mean()))
        if float(corrected.after.mean()) <= factor * float(without[worst].after.mean()):
            break
        accepted = tuple(member for member in accepted if member != worst)
    return accepted, tuple(effect for effect in effects if effect not in accepted)
