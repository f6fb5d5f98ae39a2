"""Cross-validation of a correction: how far it shrinks the gap on data it was not fitted to.

The power of the residual is the mean over signals of ((y - p) / s)^2, where y is measured, p
predicted and s the signal's white noise. Noise and declared model error alone have the floor

    1 + (f std(y) / s)^2

with f the declared share. The shrinkage of a correction is the share of the gap's amplitude above
that floor which it closes:

    1 - sqrt(after - floor) / sqrt(before - floor).

Its interval is a block bootstrap: the residual is correlated in time, so that whole blocks and not
single ticks are drawn anew [Carlstein, Ann. Stat. 14 (1986) 1171].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Interval
from rigtwin.diagnosis.fit import Fit, with_values
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.numerics.arrays import Array

BLOCK = 0.5
"""Length of a block of the bootstrap, s. The residual of a test is correlated within it."""
DRAWS = 1000
"""Number of draws of the bootstrap."""
GAP = 1.5
"""Ratio of a signal's power to that of noise and declared error from which it has a gap."""
SEED = 20
"""Seed of the bootstrap."""
Effects = tuple[Effect, ...]


@dataclass(frozen=True)
class Blocks:
    """Power of the residual in blocks of time, in units of the sensors' white noise.

    Attributes
    ----------
    before, after
        Power with the nominal and with the corrected plant, shape (blocks,).
    floor
        Power of noise and declared model error.
    """

    before: Array
    after: Array
    floor: float = 1.0


def power(evidence: Evidence, plant: Plant) -> list[Array]:
    """Return the power of the residual at every tick, averaged over the signals.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    list of arrays
        Power in units of the sensors' white noise, shape (ticks,) for each recording.
    """
    powers = []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        # A plant that diverges predicts values whose squares overflow. Infinite power is the right
        # answer.
        with np.errstate(over="ignore"):
            relative = (lines.measured - predicted) / lines.noise[:, None]
            powers.append(np.mean(relative**2, axis=0))
    return powers


def gap_level(evidence: Evidence, plant: Plant) -> float:
    """Return the gap: the rms residual of all signals in units of their white noise.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    float
        Gap over the ticks with at least half the full weight; 1 is noise alone.
    """
    powers = [
        ticks[lines.fade.max(axis=0) > 0.5]
        for ticks, lines in zip(power(evidence, plant), evidence.lines, strict=True)
    ]
    count = sum(len(part) for part in powers)
    return math.sqrt(sum(float(part.sum()) for part in powers) / max(count, 1))


def declared_floor(evidence: Evidence) -> float:
    """Return the power of noise and declared model error, in units of the white noise's power."""
    return float(np.mean(signal_floors(evidence)))


def signal_floors(evidence: Evidence) -> Array:
    """Return the power of noise and declared model error of each signal.

    Parameters
    ----------
    evidence
        Recordings with their noise.

    Returns
    -------
    array
        Power in units of each signal's white noise, shape (recordings, signals).
    """
    forms = np.array([evidence.machine.form_of(row) for row in evidence.machine.rows])
    return np.stack(
        [
            1.0 + (forms * np.std(lines.measured, axis=1) / lines.noise) ** 2
            for lines in evidence.lines
        ]
    )


def largest_shrinkage(
    evidence: Evidence, before: Plant, after: Plant, optimism: float = 1.0
) -> float:
    """Return the share of the gap that a correction closes in the signal where it closes most.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    before, after
        Nominal and corrected plant.
    optimism
        Ratio of the residual's power on held-out data to that on the data of the fit. Defaults to
        1, for recordings that were not fitted.

    Returns
    -------
    float
        Shrinkage, at most 1. Signals without a gap before the correction do not count.
    """
    powers, floors = np.zeros((2, len(evidence.names))), np.zeros(len(evidence.names))
    for lines, floor, *predictions in zip(
        evidence.lines,
        signal_floors(evidence),
        evidence.predict(before),
        evidence.predict(after),
        strict=True,
    ):
        counted = lines.fade.max(axis=0) > 0.5
        # Longer recordings count by their number of ticks, in the floor as in the powers.
        floors += np.count_nonzero(counted) * floor
        for number, predicted in enumerate(predictions):
            relative = (lines.measured - predicted)[:, counted] / lines.noise[:, None]
            powers[number] += np.sum(relative**2, axis=1)
    # On the data of the fit the corrected residual is too small; see `_validate_on_blocks`.
    powers[1] *= optimism
    return max(
        (
            shrinkage(float(nominal), float(corrected), float(floor))
            for nominal, corrected, floor in zip(*powers, floors, strict=True)
            if nominal > GAP * floor
        ),
        default=0.0,
    )


def blocks(evidence: Evidence, before: Plant, after: Plant) -> Blocks:
    """Cut the residuals of two plants into blocks of time.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    before, after
        Nominal and corrected plant.

    Returns
    -------
    Blocks
        Mean power of each block in which all ticks have at least half the full weight.
    """
    nominal_means: list[float] = []
    corrected_means: list[float] = []
    for recording, lines, nominal, corrected in zip(
        evidence.recordings,
        evidence.lines,
        power(evidence, before),
        power(evidence, after),
        strict=True,
    ):
        length = max(1, round(BLOCK / lines.period))
        # A short recording still gives several blocks to draw from.
        length = min(length, max(recording.ticks // 4, 1))
        counted = lines.fade.max(axis=0) > 0.5
        # The incomplete block at the end is dropped: means of fewer ticks scatter more than the
        # others.
        for start in range(0, len(nominal) - length + 1, length):
            if counted[start : start + length].all():
                nominal_means.append(float(np.mean(nominal[start : start + length])))
                corrected_means.append(float(np.mean(corrected[start : start + length])))
    return Blocks(np.array(nominal_means), np.array(corrected_means), declared_floor(evidence))


def shrinkage(before: float, after: float, floor: float = 1.0) -> float:
    """Return the share of the rms gap above the floor that is closed.

    Parameters
    ----------
    before, after
        Mean powers in units of the noise's power.
    floor
        Power of noise and declared error.

    Returns
    -------
    float
        At most 1; negative if the gap grows.
    """
    gap = math.sqrt(max(before - floor, 0.0))
    remainder = math.sqrt(max(after - floor, 0.0))
    return 1.0 - remainder / gap if gap > 0.0 else 0.0


def interval(residual: Blocks) -> Interval:
    """Return the shrinkage over all blocks with its 95 % bootstrap interval.

    Parameters
    ----------
    residual
        Power of the residual in blocks of time.

    Returns
    -------
    Interval
        Shrinkage with its interval; zeros if there is no block.
    """
    count = len(residual.before)
    if not count:
        return Interval(0.0, 0.0, 0.0)
    # The seed is fixed: the same recordings give the same answer.
    random = np.random.default_rng(SEED)
    drawn = random.integers(0, count, (DRAWS, count))
    # Both residuals are drawn by the same blocks. What raises both, such as a fast part of the
    # motion, then cancels in their ratio.
    before, after = residual.before[drawn].mean(axis=1), residual.after[drawn].mean(axis=1)
    values = [shrinkage(b, a, residual.floor) for b, a in zip(before, after, strict=True)]
    # The percentiles of the draws serve as interval (Efron), since a ratio of square roots is
    # skewed and may be far from normal.
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(_shrinkage_of(residual), float(low), float(high))


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
        predicted=_shrinkage_of(inside),
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
        predicted=_shrinkage_of(inside),
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


def _shrinkage_of(residual: Blocks) -> float:
    """Return the shrinkage over all blocks; 0 if there is none."""
    if not len(residual.before):
        return 0.0
    before, after = float(residual.before.mean()), float(residual.after.mean())
    return shrinkage(before, after, residual.floor)


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
