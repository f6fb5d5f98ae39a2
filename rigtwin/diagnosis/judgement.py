"""Judgement of the named effects: what they leave and which verdict follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect, with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.diagnosis.answer import Verdict
from rigtwin.diagnosis.cross_validation import Validation, validate, with_effects
from rigtwin.diagnosis.estimates import is_timing
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.findings import choose_named, measure_support
from rigtwin.diagnosis.gap import Gap, Interval
from rigtwin.diagnosis.readings import SignalReadings
from rigtwin.diagnosis.sampling import SensorProperty
from rigtwin.diagnosis.shrinkage import gap_level
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import Thresholds

LOST, STANDS_OUT = 0.5, 5.0
"""Share of a signal's standard deviation, and multiple of its noise, from which a residual is no
noise, whatever the integration errors are."""


@dataclass(frozen=True)
class Judgement:
    """Effects that are named, and what the correction by them leaves.

    Attributes
    ----------
    explanation
        Result of the search.
    support
        Support of each effect of the best hypothesis.
    validation
        Validation of the chosen effects on held-out data.
    named
        Effects that survive the validation.
    has_residual
        Whether more than noise and declared error remains.
    plant
        Plant with the named effects.
    notes
        Reasons why chosen effects are not named.
    """

    explanation: Explanation
    support: dict[Effect, Support]
    validation: Validation
    named: tuple[Effect, ...]
    has_residual: bool
    plant: Plant
    notes: tuple[str, ...]


def judge(
    evidence: Evidence,
    held_out: Evidence | None,
    explanation: Explanation,
    thresholds: Thresholds,
) -> Judgement:
    """Choose the effects that are named, and validate them on held-out data.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    held_out
        Recordings that judge the correction. None leaves blocks of the fitted ones out in turn.
    explanation
        Result of the search.
    thresholds
        Thresholds of the naming.

    Returns
    -------
    Judgement
        Named effects, the corrected plant and what remains.
    """
    support = measure_support(explanation, evidence, thresholds)
    chosen = choose_named(explanation, support, evidence, thresholds)
    validation = validate(
        evidence, explanation.fit, chosen, explanation.posterior, held_out, thresholds
    )
    named, notes = validation.accepted, []
    has_residual = _has_residual(explanation, evidence, named)
    if validation.rejected:
        names = " and ".join(effect.name for effect in validation.rejected)
        notes.append(f"{names} rejected: the prediction of held-out data became worse with it")
    # Beside a large residual, an effect that removes little of any signal's gap is a coincidence.
    if named and has_residual and validation.largest < thresholds.removed_share:
        names = " and ".join(effect.name for effect in named)
        share = f"{100 * validation.largest:.0f} %"
        notes.append(f"{names} not named: the correction closes at most {share} of a signal's gap")
        named = ()
    plant = with_effects(evidence.plant, explanation.fit, named)
    if _is_lost(evidence, plant):
        has_residual = True
        notes.append("the prediction misses most of a signal, so that little can be concluded")
    return Judgement(explanation, support, validation, named, has_residual, plant, tuple(notes))


def _is_lost(evidence: Evidence, plant: Plant) -> bool:
    """Return whether a prediction misses most of a signal that stands out of its noise.

    Where the steps of the integration decide on a motion, their error counts as noise, and hardly
    anything is left to be judged.
    """
    for lines, differences in zip(evidence.lines, evidence.differences(plant), strict=True):
        missed = np.sqrt(lines.mean(differences**2))
        least = np.maximum(LOST * np.std(lines.measured, axis=1), STANDS_OUT * lines.noise)
        if np.any(missed > least):
            return True
    return False


def _has_residual(explanation: Explanation, evidence: Evidence, named: Sequence[Effect]) -> bool:
    """Return whether more than noise and declared error remains after the named effects."""
    posterior, fit = explanation.posterior, explanation.fit
    # A shift within the tolerance of the sampling time leaves no residual.
    findings = {
        effect
        for effect, values in zip(fit.effects, fit.values, strict=True)
        if not is_timing(effect, values, evidence)
    }
    if set(named) == findings:
        return posterior.has_unexplained_residual and not explanation.leaves_noise
    # The named effects may be another scored hypothesis than the best one.
    identical = [
        hypothesis.scored
        for hypothesis in posterior.ranking
        if set(hypothesis.scored.fit.effects) == set(named)
    ]
    # What an effect that was fitted but not named explains is a part of the residual.
    scored = identical[0] if identical else posterior.empty
    excess = posterior.loss(scored) - posterior.loss(posterior.best) + posterior.unexplained
    return excess > posterior.prices.ordinary


def choose_verdict(
    judged: Judgement, readings: SignalReadings, effects: Sequence[Finding], thresholds: Thresholds
) -> Verdict:
    """Return the verdict of an answer.

    Parameters
    ----------
    judged
        Named effects and what remains.
    readings
        Properties of controller and sensors that were read off signals.
    effects
        Findings of the answer.
    thresholds
        Thresholds, of which the share that an explanation must close is used.
    """
    has_residual = judged.has_residual or readings.has_unknown_controller
    if not effects:
        return "unknown" if has_residual else "no gap"
    closes_enough = not judged.named or _closed_share(judged) >= thresholds.explained_share
    return "explained" if closes_enough and not has_residual else "partly explained"


def measure_gap(evidence: Evidence, judged: Judgement, sampled: Sequence[SensorProperty]) -> Gap:
    """Return the gap before and after the correction.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    judged
        Named effects and their validation.
    sampled
        Sensor properties that were read off signals.
    """
    plant, validation = judged.plant, judged.validation
    corrected = corrected_configuration(evidence.configurations[0], plant, sampled)
    replays, loop = evidence.machine.physics.levels(evidence, plant, corrected)
    closed = validation.held_out
    if not validation.measurable:
        closed = Interval(*(_closed_share(judged),) * 3)
    return Gap(
        before=gap_level(evidence, evidence.plant),
        after=gap_level(evidence, plant),
        floor=1.0,
        shrinkage_predicted=validation.predicted,
        shrinkage_held_out=closed,
        held_out=validation.data,
        replays=replays,
        closed_loop=loop,
    )


def _closed_share(judged: Judgement) -> float:
    """Return the share of the gap that the correction closes on held-out data.

    A gap in few frequencies does not raise the rms over all of them above the floor; the closed
    share then comes from the spectral lines.
    """
    posterior, validation = judged.explanation.posterior, judged.validation
    if validation.measurable:
        return validation.held_out.value
    return posterior.closes(posterior.best) if judged.named else 0.0


def corrected_configuration(
    nominal: Configuration, plant: Plant, sampled: Sequence[SensorProperty]
) -> Configuration:
    """Return the settings with the corrected plant.

    Parameters
    ----------
    nominal
        Settings of the recording.
    plant
        Plant with the named effects.
    sampled
        Sensor properties that were read off signals; they are corrected as well.
    """
    for sensor in sampled:
        plant = with_parameters(plant, sensor.component, {sensor.parameter: sensor.value})
    return nominal._replace(plant=plant)
