"""How far a correction shrinks the gap, on data that it was not fitted to."""

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
"""s, length of a block of the bootstrap: what a test leaves is correlated within it."""
DRAWS = 1000
"""Draws of the bootstrap."""
GAP = 1.5
"""Ratio of a signal's power to that of noise and declared error from which it has a gap."""
SEED = 20
"""Seed of the bootstrap."""
Effects = tuple[Effect, ...]


@dataclass(frozen=True)
class Blocks:
    """Power of the residual in blocks of time, in units of the sensors' white noise.

    Parameters
    ----------
    before, after
        With the nominal and with the corrected plant, shape (blocks,).
    floor
        Power that noise and the declared model error have.
    """

    before: Array
    after: Array
    floor: float = 1.0


def power(evidence: Evidence, plant: Plant) -> list[Array]:
    """Mean power over the sensors at every tick, in units of their white noise's, shape (ticks,)
    for each recording."""
    found = []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        relative = (lines.measured - predicted) / lines.noise[:, None]
        found.append(np.mean(relative**2, axis=0))
    return found


def gap_level(evidence: Evidence, plant: Plant) -> float:
    """rms of all signals less what a plant predicts, in units of their white noise, where a test
    counts."""
    powers = [
        each[lines.fade.max(axis=0) > 0.5]
        for each, lines in zip(power(evidence, plant), evidence.lines, strict=True)
    ]
    ticks = sum(len(each) for each in powers)
    return math.sqrt(sum(float(each.sum()) for each in powers) / max(ticks, 1))


def declared_floor(evidence: Evidence) -> float:
    """Power of noise and declared model error, in units of the sensors' white noise."""
    return float(np.mean(signal_floors(evidence)))


def signal_floors(evidence: Evidence) -> Array:
    """Power of noise and declared model error of each signal, in units of its white noise, shape
    (recordings, signals)."""
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
    """Share of the gap that a correction closes in the signal where it closes most.

    Parameters
    ----------
    evidence
        The recordings.
    before, after
        The nominal and the corrected plant.
    optimism
        Factor by which a fit's residual has more power on data left out than on its own; 1 if the
        recordings are not those of the fit.

    Returns
    -------
    float
        At most 1; signals without a gap before do not count.
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
        floors += np.count_nonzero(counted) * floor
        for number, predicted in enumerate(predictions):
            relative = (lines.measured - predicted)[:, counted] / lines.noise[:, None]
            powers[number] += np.sum(relative**2, axis=1)
    powers[1] *= optimism
    return max(
        (
            shrinkage(float(one), float(other), float(least))
            for one, other, least in zip(*powers, floors, strict=True)
            if one > GAP * least
        ),
        default=0.0,
    )


def blocks(evidence: Evidence, before: Plant, after: Plant) -> Blocks:
    """Cut the residuals of two plants into blocks."""
    pairs: tuple[list[float], list[float]] = ([], [])
    for recording, lines, one, other in zip(
        evidence.recordings,
        evidence.lines,
        power(evidence, before),
        power(evidence, after),
        strict=True,
    ):
        length = max(1, round(BLOCK / lines.period))
        length = min(length, max(recording.ticks // 4, 1))
        counted = lines.fade.max(axis=0) > 0.5
        for start in range(0, len(one) - length + 1, length):
            if counted[start : start + length].all():
                pairs[0].append(float(np.mean(one[start : start + length])))
                pairs[1].append(float(np.mean(other[start : start + length])))
    return Blocks(np.array(pairs[0]), np.array(pairs[1]), declared_floor(evidence))


def shrinkage(before: float, after: float, floor: float = 1.0) -> float:
    """Share of the rms gap above the floor that is closed; negative if it grows.

    Parameters
    ----------
    before, after
        Mean powers in units of the noise's.
    floor
        Power of noise and declared error.
    """
    gap = math.sqrt(max(before - floor, 0.0))
    left = math.sqrt(max(after - floor, 0.0))
    return 1.0 - left / gap if gap > 0.0 else 0.0


def interval(of: Blocks) -> Interval:
    """The shrinkage over blocks, with its 95 % interval by drawing blocks anew."""
    if not len(of.before):
        return Interval(0.0, 0.0, 0.0)
    random = np.random.default_rng(SEED)
    drawn = random.integers(0, len(of.before), (DRAWS, len(of.before)))
    before, after = of.before[drawn].mean(axis=1), of.after[drawn].mean(axis=1)
    values = [shrinkage(b, a, of.floor) for b, a in zip(before, after, strict=True)]
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(
        shrinkage(float(of.before.mean()), float(of.after.mean()), of.floor),
        float(low),
        float(high),
    )


@dataclass(frozen=True)
class Validation:
    """What a correction does on data held out of its fit.

    Parameters
    ----------
    predicted
        Share of the gap that it closes on the data of the fit.
    held_out
        Share that it closes on data held out of the fit.
    kept
        Effects that do not make held-out data worse.
    rejected
        Effects that do.
    data
        What was held out, in words.
    largest
        Share that the kept effects close in the signal where they close most.
    measurable
        Whether the whole gap exceeds noise and declared error before the correction. One that
        stands in few frequencies may not, and be clear there all the same.
    """

    predicted: float
    held_out: Interval
    kept: Effects
    rejected: Effects
    data: str
    largest: float
    measurable: bool


def validate(
    evidence: Evidence,
    fit: Fit,
    named: Effects,
    posterior: HypothesisPosterior,
    other: Evidence | None = None,
    thresholds: Thresholds = STANDARD,
) -> Validation:
    """Judge a fit on data held out of it.

    Parameters
    ----------
    evidence
        Evidence that it was fitted to.
    fit
        The best hypothesis.
    named
        Effects of it that are named.
    posterior
        Its cross-validation, used where no other data are given.
    other
        Evidence of recordings held out of the fit.
    thresholds
        Numbers that it goes by.

    Returns
    -------
    Validation
        How far the gap shrinks, and which effects stay.
    """
    inside = blocks(evidence, evidence.plant, with_effects(evidence.plant, fit, named))
    predicted = _shrinkage_of(inside)
    if other is None:
        best = posterior.best
        out, own = (float(np.sum(each * best.samples)) for each in (best.levels, best.inside))
        optimism = max(out / max(own, 1e-300), 1.0)
        after = inside.after * optimism
        closed = interval(Blocks(inside.before, after, inside.floor))
        largest = largest_shrinkage(
            evidence, evidence.plant, with_effects(evidence.plant, fit, named), optimism
        )
        return Validation(
            predicted,
            closed,
            named,
            (),
            "blocks left out of the fit in turn",
            largest,
            _is_measurable(inside),
        )

    def across(kept: Effects) -> Blocks:
        return blocks(other, evidence.plant, with_effects(evidence.plant, fit, kept))

    count = len(other.recordings)
    data = f"{count} held-out recording{'s' if count > 1 else ''}"
    kept, rejected = reject_worsening(named, across, thresholds.worsening_factor)
    largest = largest_shrinkage(other, evidence.plant, with_effects(evidence.plant, fit, kept))
    outside = across(kept)
    return Validation(
        predicted, interval(outside), kept, rejected, data, largest, _is_measurable(outside)
    )


def _is_measurable(of: Blocks) -> bool:
    return bool(len(of.before)) and float(of.before.mean()) > of.floor


def _shrinkage_of(of: Blocks) -> float:
    if not len(of.before):
        return 0.0
    return shrinkage(float(of.before.mean()), float(of.after.mean()), of.floor)


def with_effects(plant: Plant, fit: Fit, kept: Sequence[Effect]) -> Plant:
    """The plant with those of a fit's effects that are kept."""
    pairs = [
        (effect, values)
        for effect, values in zip(fit.effects, fit.values, strict=True)
        if effect in kept
    ]
    return with_values(plant, [effect for effect, _ in pairs], [values for _, values in pairs])


def reject_worsening(
    effects: Effects, across: Callable[[Effects], Blocks], worse: float = STANDARD.worsening_factor
) -> tuple[Effects, Effects]:
    """Reject effects that make held-out data worse.

    Parameters
    ----------
    effects
        Effects of a correction.
    across
        Residual of held-out data with some of the effects.
    worse
        Factor of the residual's power from which an effect is rejected.

    Returns
    -------
    tuple
        Effects that are kept, and those that are rejected.
    """
    kept = effects
    while kept:
        left = across(kept)
        if not len(left.after):
            break
        # One that is far off spoils the others' standing: the worst goes first.
        without = {
            effect: across(tuple(other for other in kept if other != effect)) for effect in kept
        }
        worst = min(kept, key=lambda effect: float(without[effect].after.mean()))
        if float(left.after.mean()) <= worse * float(without[worst].after.mean()):
            break
        kept = tuple(other for other in kept if other != worst)
    return kept, tuple(effect for effect in effects if effect not in kept)
