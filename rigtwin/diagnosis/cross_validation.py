"""How far a correction shrinks the gap, on data that it was not fitted to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.finding import Interval
from rigtwin.diagnosis.fit import Fit, is_possible, with_values, without_each
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording

BLOCK = 0.5
"""s; within it what a test leaves hangs together, so it is drawn as a whole."""
DRAWS = 1000
SEED = 20
"""Of the bootstrap's draws."""
TAPER = 0.1
"""s, over which a part of a recording begins and ends to count."""


Effects = tuple[Effect, ...]


@dataclass(frozen=True)
class Blocks:
    """Power of what is left, in units of the sensors' white noise power, by blocks of time: with
    the nominal plant and with the corrected one. Shape (blocks,) each."""

    before: Array
    after: Array

    def join(self, other: Blocks) -> Blocks:
        return Blocks(
            np.concatenate([self.before, other.before]), np.concatenate([self.after, other.after])
        )


def power(evidence: Evidence, plant: Plant) -> list[Array]:
    """Mean power over the sensors at every tick, in units of their white noise's, shape (ticks,)
    for each recording."""
    found = []
    for each, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        relative = (each.measured - predicted) / each.noise[:, None]
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


def blocks(evidence: Evidence, before: Plant, after: Plant, counted: Sequence[Array]) -> Blocks:
    """The blocks of the parts that count."""
    pairs: tuple[list[float], list[float]] = ([], [])
    for recording, part, each, one, other in zip(
        evidence.recordings,
        counted,
        evidence.lines,
        power(evidence, before),
        power(evidence, after),
        strict=True,
    ):
        length = max(1, round(BLOCK / recording.period))
        weight = part * (each.fade.max(axis=0) > 0.5)
        for start in range(0, len(one) - length + 1, length):
            if weight[start : start + length].min() > 0.5:
                pairs[0].append(float(np.mean(one[start : start + length])))
                pairs[1].append(float(np.mean(other[start : start + length])))
    return Blocks(np.array(pairs[0]), np.array(pairs[1]))


def shrinkage(before: float, after: float) -> float:
    """Share of the rms gap above the floor that is closed, for mean powers in units of the noise's;
    negative if worse."""
    gap, left = math.sqrt(max(before - 1.0, 0.0)), math.sqrt(max(after - 1.0, 0.0))
    return 1.0 - left / gap if gap > 0.0 else 0.0


def interval(of: Blocks) -> Interval:
    """The shrinkage over blocks, with its 95 % interval by drawing blocks anew."""
    if not len(of.before):
        return Interval(0.0, 0.0, 0.0)
    random = np.random.default_rng(SEED)
    drawn = random.integers(0, len(of.before), (DRAWS, len(of.before)))
    before, after = of.before[drawn].mean(axis=1), of.after[drawn].mean(axis=1)
    values = [shrinkage(b, a) for b, a in zip(before, after, strict=True)]
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(
        shrinkage(float(of.before.mean()), float(of.after.mean())), float(low), float(high)
    )


@dataclass(frozen=True)
class Validation:
    """What a correction does on data held out of its fit. kept: effects that do not worsen them;
    rejected: those that do; idle: those that together close nothing of the gap there; halves: the
    fits to each half of the recordings, where they were made."""

    predicted: float
    held_out: Interval
    kept: tuple[Effect, ...]
    rejected: tuple[Effect, ...]
    data: str
    halves: tuple[Fit, ...] = ()
    fit: Fit | None = None
    idle: tuple[Effect, ...] = ()


def halves(recordings: Sequence[Recording]) -> tuple[list[Array], list[Array]]:
    """Two ways to count ticks: the first and the second half of every recording."""
    first, second = [], []
    for recording in recordings:
        time = np.arange(recording.ticks) * recording.period
        middle = 0.5 * recording.ticks * recording.period
        rise = np.clip((time - middle) / TAPER + 0.5, 0.0, 1.0)
        second.append(0.5 - 0.5 * np.cos(np.pi * rise))
        first.append(1.0 - second[-1])
    return first, second


def _refit(evidence: Evidence, fit: Fit) -> Fit:
    return Fitter(evidence).refine(
        fit.effects, fit.values, Space(evidence, fit.plant, None, fit.effects)
    )


def _fit_halves(evidence: Evidence, fit: Fit) -> tuple[tuple[list[Array], list[Array]], list[Fit]]:
    """The halves of the recordings, and the fit made again to each."""
    parts = halves(evidence.recordings)
    if not fit.effects:
        return parts, [fit, fit]

    def refit(part: list[Array]) -> Fit:
        half = Evidence(evidence.machine, evidence.recordings, evidence.configurations, part)
        return _refit(half, fit)

    with Threads() as threads:
        return parts, threads.map(refit, parts)


def validate(
    evidence: Evidence,
    fit: Fit,
    other: Evidence | None = None,
    thresholds: Thresholds = STANDARD,
) -> Validation:
    """Validates a fit on data held out of it.

    Parameters
    ----------
    evidence
        What it was fitted to.
    fit
        The correction.
    other
        Evidence held out of it; without any, each half of the recordings after a fit to the other.
    thresholds
        What figures are held against.

    Returns
    -------
    Validation
        How far the gap shrinks there, and which effects stay.
    """
    everything = [np.ones(recording.ticks) for recording in evidence.recordings]
    idle: Effects = ()
    if other is not None:
        inside = blocks(evidence, evidence.plant, fit.plant, everything)
        predicted = (
            shrinkage(float(inside.before.mean()), float(inside.after.mean()))
            if len(inside.before)
            else 0.0
        )
        whole = [np.ones(recording.ticks) for recording in other.recordings]
        data = f"{len(whole)} held-out recording{'s' if len(whole) > 1 else ''}"

        def blocks_of(plant: Plant) -> Blocks:
            return blocks(other, evidence.plant, plant, whole)

        def blocks_with(kept: tuple[Effect, ...]) -> Blocks:
            return blocks_of(with_effects(evidence.plant, fit, kept))

        if evidence.machine.rough:
            whole_fit = fit
            fit = _drop_unnecessary(evidence, fit, other, thresholds.selection.needed)
            kept = fit.effects
            rejected = tuple(effect for effect in whole_fit.effects if effect not in kept)
        else:
            kept, rejected = reject_worsening(fit.effects, blocks_with, thresholds.worse)
            kept, idle = drop_idle(kept, interval(blocks_with(kept)))
        apart = _fit_halves(evidence, fit)[1] if evidence.machine.rough else []
        return Validation(
            predicted=predicted,
            held_out=interval(blocks_with(kept)),
            kept=kept,
            rejected=rejected,
            data=data,
            halves=tuple(apart),
            fit=fit,
            idle=idle,
        )
    parts, fits = _fit_halves(evidence, fit)
    predictions, outcomes = [], []
    for own, foreign, refitted in zip(parts, parts[::-1], fits, strict=True):
        inside = blocks(evidence, evidence.plant, refitted.plant, own)
        predictions.append(
            shrinkage(float(inside.before.mean()), float(inside.after.mean()))
            if len(inside.before)
            else 0.0
        )
        outcomes.append((refitted, foreign))

    def blocks_across(kept: tuple[Effect, ...]) -> Blocks:
        found = [
            blocks(evidence, evidence.plant, with_effects(evidence.plant, refitted, kept), part)
            for refitted, part in outcomes
        ]
        return found[0].join(found[1])

    kept, rejected = fit.effects, ()
    if not evidence.machine.rough:
        # Of a rough model the explanation was chosen by what is held out of its fit already.
        kept, rejected = reject_worsening(fit.effects, blocks_across, thresholds.worse)
        kept, idle = drop_idle(kept, interval(blocks_across(kept)))
    return Validation(
        predicted=float(np.mean(predictions)),
        held_out=interval(blocks_across(kept)),
        kept=kept,
        rejected=rejected,
        data="each half, fitted to the other",
        halves=tuple(fits),
        idle=idle,
    )


def _drop_unnecessary(evidence: Evidence, fit: Fit, other: Evidence, needed: float) -> Fit:
    """The fit less the effects without which held-out recordings are predicted as well, the others
    fitted again; every recording counts alike, and most of them must ask for an effect."""
    fitter = Fitter(evidence)
    while fit.effects:
        own = np.log(relative_errors(other, fit.plant))
        losses = []
        for _, rest, values in without_each(fit):
            if not is_possible(rest, evidence.plant):
                continue
            simpler = fitter.refine(rest, values)
            lost = np.log(relative_errors(other, simpler.plant)) - own
            if float(np.mean(lost)) < needed or float(np.mean(lost > 0.0)) < 0.5:
                losses.append((float(np.mean(lost)), simpler))
        if not losses:
            return fit
        fit = min(losses, key=lambda pair: pair[0])[1]
    return fit


def with_effects(plant: Plant, fit: Fit, kept: Sequence[Effect]) -> Plant:
    """The plant with those of a fit's effects that are kept."""
    pairs = [
        (effect, values)
        for effect, values in zip(fit.effects, fit.values, strict=True)
        if effect in kept
    ]
    return with_values(plant, [effect for effect, _ in pairs], [values for _, values in pairs])


def drop_idle(kept: Effects, closed: Interval) -> tuple[Effects, Effects]:
    """(kept, idle) effects: of a correction that surely closes nothing of the gap on what is held
    out, none stays. closed: share of the gap that it closes there."""
    return ((), kept) if closed.high < 0.0 else (kept, ())


def reject_worsening(
    effects: Effects, across: Callable[[Effects], Blocks], worse: float = STANDARD.worse
) -> tuple[Effects, Effects]:
    """(kept, rejected) effects: none stays that makes held-out data worse, beyond `worse` times.
    across: what is left with some of the effects."""
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
