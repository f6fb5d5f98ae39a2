"""Diagnose why recordings and the twin disagree: recordings in, one answer out.

data checks → evidence (residuals) → search for effects → validation on held-out data → location of
the residual → properties read off signals (controller, sensors) → next test → answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from threadpoolctl import threadpool_limits

from rigtwin.components import Effect, with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.confounding import find_confounded
from rigtwin.diagnosis.contacts import find_contacts
from rigtwin.diagnosis.cross_validation import Validation, validate, with_effects
from rigtwin.diagnosis.data_checks import SHORTEST_PART, find_faults, require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation, candidates, explain
from rigtwin.diagnosis.finding import (
    Answer,
    Finding,
    Gap,
    Interval,
    NextTest,
    Place,
    Tolerated,
    Verdict,
)
from rigtwin.diagnosis.findings import (
    choose_named,
    describe_attributed,
    find_nearest,
    find_traces,
    is_timing,
    list_unobservable,
    measure_support,
)
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.join import join
from rigtwin.diagnosis.leftover import leftovers, steps
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.next_test import propose_test
from rigtwin.diagnosis.readings import SignalReadings, describe_readings, read_signals
from rigtwin.diagnosis.regressors import describe_correlation
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.sampling import SensorProperty
from rigtwin.diagnosis.short_recordings import least_ticks
from rigtwin.diagnosis.shrinkage import gap_level
from rigtwin.diagnosis.signal_findings import (
    describe_negligible,
)
from rigtwin.diagnosis.stops import find_cut_commands, find_stops
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.text import sentence
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.tolerated import describe_used_up, find_used_up
from rigtwin.diagnosis.unknown_input import DisturbanceFit, locate_disturbance
from rigtwin.diagnosis.unused_channels import describe_unused
from rigtwin.diagnosis.usable_data import (
    answer_unusable,
    drop_unneeded,
    recording_notes,
)
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.simulation.energy import EnergyError
from rigtwin.simulation.experiment import Experiment

RANKED = 8
"""Explanations in the ranking of an answer."""
SEPARATED = 4
"""Explanations that a next test should separate at most."""


@dataclass(frozen=True)
class _Judged:
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


def diagnose(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    base: Configuration | None = None,
    held_out: Sequence[RecordedTest] = (),
    tests: Sequence[Experiment] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
    thresholds: Thresholds = STANDARD,
    first_look: Callable[[FirstLook], object] = lambda _: None,
) -> Diagnosis:
    """Find out why recordings of one machine and its twin disagree.

    Parameters
    ----------
    machine
        Machine that was recorded.
    recordings
        Recordings fitted jointly.
    base
        Twin that they are compared with. Defaults to the described one.
    held_out
        Recordings that judge the correction and are not fitted. Without any, blocks of the fitted
        recordings are left out in turn.
    tests
        Menu of experiments from which the next test is chosen.
    progress
        Called with the name of a stage and the number of steps done in it.
    thresholds
        Thresholds of all stages.
    first_look
        Called with the gap and its suspects once every effect was tried. For a machine of several
        joints that do not act on each other it is called once per joint.

    Returns
    -------
    Diagnosis
        The answer, and the corrected twin.

    Raises
    ------
    RigtwinError
        If the settings of a recording are unknown, or held-out recordings are unusable or hold the
        same data as fitted ones.
    """
    started = time.perf_counter()
    recordings, held_out, notes = drop_unneeded(recordings, held_out)
    # BLAS threads would compete with the threads of the search.
    with threadpool_limits(1):
        configurations = [machine.configuration_of(recording, base) for recording in recordings]
        unusable = answer_unusable(machine, recordings, configurations, started)
        if unusable is not None:
            return Diagnosis(unusable, machine, None, configurations[0])
        judging_configurations = _configure_held_out(machine, held_out, base)
        notes += _contact_notes(machine, recordings)
        fitted, judging = (recordings, configurations), (held_out, judging_configurations)
        evidence_of = partial(_gather_evidence, fitted=fitted, judging=judging)

        diagnosis = _diagnose_parts(
            machine, evidence_of, tests, progress, first_look, thresholds, started
        )
        return _with_notes(diagnosis, notes)


def _gather_evidence(
    part: Machine,
    fitted: tuple[list[RecordedTest], list[Configuration]],
    judging: tuple[list[RecordedTest], list[Configuration]],
) -> tuple[Evidence, Evidence | None]:
    """Evidence of a part of a machine, and that of the held-out recordings if there are any."""
    held_out = Evidence(part, *judging) if judging[0] else None
    return Evidence(part, *fitted), held_out


def _diagnose_parts(
    machine: Machine,
    evidence_of: Callable[[Machine], tuple[Evidence, Evidence | None]],
    tests: Sequence[Experiment],
    progress: Callable[[str, int], object],
    first_look: Callable[[FirstLook], object],
    thresholds: Thresholds,
    started: float,
) -> Diagnosis:
    """Diagnose the independent parts of a machine, and join their answers."""
    # Joints that do not act on each other are diagnosed one by one: their effects cannot be
    # confounded, and the search is much smaller.
    parts = [
        _diagnose_part(*evidence_of(part), tests, progress, first_look, thresholds, started)
        for part in machine.physics.split(machine)
    ]
    # Joining needs evidence of the whole machine, which costs further predictions.
    return parts[0] if len(parts) == 1 else join(*evidence_of(machine), parts, started)


def _contact_notes(machine: Machine, recordings: Sequence[RecordedTest]) -> list[str]:
    return [
        f"{recording.path.name}: {line}"
        for recording in recordings
        for line in find_contacts(machine, recording)
    ]


def _configure_held_out(
    machine: Machine, held_out: Sequence[RecordedTest], base: Configuration | None
) -> list[Configuration]:
    """Settings of the held-out recordings; raises where one of them cannot be compared."""
    configurations = [machine.configuration_of(recording, base) for recording in held_out]
    for recording, configuration in zip(held_out, configurations, strict=True):
        require_fit(machine, recording, configuration, least_ticks(held_out))
    return configurations


def _with_notes(diagnosis: Diagnosis, notes: Sequence[str]) -> Diagnosis:
    answer = replace(diagnosis.answer, notes=(*notes, *diagnosis.answer.notes))
    return replace(diagnosis, answer=answer)


def _diagnose_part(
    evidence: Evidence,
    held_out: Evidence | None,
    tests: Sequence[Experiment],
    progress: Callable[[str, int], object],
    first_look: Callable[[FirstLook], object],
    thresholds: Thresholds,
    started: float,
) -> Diagnosis:
    """Diagnose joints that act on each other."""
    explanation = explain(
        evidence, lambda steps: progress("fitting effects", steps), thresholds, first_look
    )
    progress("validating on held-out data", 1)
    judged = _judge(evidence, held_out, explanation, thresholds)
    named, plant = judged.named, judged.plant
    progress("locating the residual", 1)
    disturbances = locate_disturbance(evidence, plant, named) if judged.has_residual else ()
    # Noise and hum are read off the residual of the corrected twin, which the named effects no
    # longer disturb.
    readings = read_signals(evidence, plant, thresholds)
    attributed = describe_attributed(explanation, named, judged.support, evidence, thresholds)
    effects = [*attributed, *describe_readings(readings, evidence, thresholds)]
    verdict = _choose_verdict(judged, readings, effects, thresholds)
    where = _places(evidence, attributed, judged, disturbances, readings)
    progress("replaying components", 1)
    gap = _measure_gap(evidence, judged, readings.sampled)
    progress("choosing the next test", 1)
    next_test = _next_test(evidence.machine, explanation, effects, named, tests, thresholds)
    has_gap = verdict != "no gap"
    tolerated = () if judged.has_residual else find_used_up(evidence, explanation.fit, judged.named)
    answer = Answer(
        verdict=verdict,
        sentence=sentence(verdict, effects, where, gap, bool(tolerated)),
        effects=tuple(effects),
        where=tuple(where),
        gap=gap,
        ranking=tuple(
            (hypothesis.scored.fit.name, hypothesis.weight)
            for hypothesis in explanation.posterior.ranking[:RANKED]
        ),
        next_test=next_test,
        not_observable=list_unobservable(explanation, attributed),
        notes=tuple(_collect_notes(evidence, judged, readings, tolerated, thresholds)),
        recordings=tuple(str(recording.path) for recording in evidence.recordings),
        seconds=time.perf_counter() - started,
        machine=evidence.machine.name,
        steps=steps(evidence, explanation.chain if has_gap else (), held_out or evidence),
        units={row.name: row.unit for row in evidence.machine.rows},
        leftovers=tuple(leftovers(evidence, plant, disturbances, thresholds))
        if disturbances
        else (),
        traces=find_traces(explanation, named, evidence, thresholds) if has_gap else (),
        confounded=find_confounded(evidence, explanation.fit, named, candidates(evidence)),
        nearest=find_nearest(explanation, evidence) if verdict == "unknown" else None,
        energy=_energy(evidence),
        tolerated=tolerated,
    )
    corrected = _correct(evidence.configurations[0], plant, readings.sampled)
    otherwise = _other_explanations(explanation, named, thresholds.alternative_weight)
    return Diagnosis(answer, evidence.machine, evidence, corrected, otherwise, held_out)


def _judge(
    evidence: Evidence,
    held_out: Evidence | None,
    explanation: Explanation,
    thresholds: Thresholds,
) -> _Judged:
    """Choose the effects that are named, and validate them on held-out data."""
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
    return _Judged(explanation, support, validation, named, has_residual, plant, tuple(notes))


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


def _choose_verdict(
    judged: _Judged, readings: SignalReadings, effects: Sequence[Finding], thresholds: Thresholds
) -> Verdict:
    has_residual = judged.has_residual or readings.has_unknown_controller
    if not effects:
        return "unknown" if has_residual else "no gap"
    closes_enough = not judged.named or _closed_share(judged) >= thresholds.explained_share
    return "explained" if closes_enough and not has_residual else "partly explained"


def _collect_notes(
    evidence: Evidence,
    judged: _Judged,
    readings: SignalReadings,
    tolerated: Sequence[Tolerated],
    thresholds: Thresholds,
) -> list[str]:
    cut = (
        f"the search ended after about {thresholds.effort:.0f} s of processor time, before all "
        f"hypotheses were tried: an effect may be missing, or named in the place of another; "
        f"--effort {5 * thresholds.effort:.0f} searches longer"
    )
    return [
        *([cut] if judged.explanation.ended_early else []),
        *recording_notes(evidence.recordings),
        *_prediction_notes(evidence),
        *_clipping_notes(evidence),
        *find_stops(evidence.machine, evidence.recordings),
        *find_cut_commands(evidence.machine, evidence.recordings),
        *judged.notes,
        *describe_unused(evidence, judged.plant),
        *map(describe_negligible, readings.negligible),
        *describe_used_up(tolerated),
    ]


def _other_explanations(
    explanation: Explanation, named: Sequence[Effect], least: float
) -> tuple[tuple[Fit, float], ...]:
    """Explanations other than the named one with at least a certain weight, the best first."""
    return tuple(
        (hypothesis.scored.fit, hypothesis.weight)
        for hypothesis in explanation.posterior.ranking
        if hypothesis.scored.fit.effects
        and set(hypothesis.scored.fit.effects) != set(named)
        and hypothesis.weight >= least
    )


def _prediction_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {note}"
        for recording, model in zip(evidence.recordings, evidence.models, strict=True)
        for note in model.notes()
    ]


def _clipping_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {fault.message}; those ticks are left out"
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
        # The length was judged before, by the rules for the whole set.
        for fault in find_faults(evidence.machine, recording, configuration, SHORTEST_PART)
        if not fault.fatal
    ]


def _places(
    evidence: Evidence,
    attributed: Sequence[Finding],
    judged: _Judged,
    disturbances: tuple[DisturbanceFit, ...],
    readings: SignalReadings,
) -> list[Place]:
    """Locations of the named effects and of the residual, then the controller if it is unknown."""
    named, fit = judged.named, judged.explanation.fit
    places: dict[str, Place] = {}
    predicted = evidence.predict(judged.plant)
    for effect, finding in zip(
        [effect for effect in fit.effects if effect in named], attributed, strict=True
    ):
        # An effect acts where removing it alone changes the prediction.
        rest = [other for other in named if other != effect]
        without = evidence.predict(with_effects(evidence.plant, fit, rest))
        change: list[Array] = [a - b for a, b in zip(predicted, without, strict=True)]
        place = locate(evidence, effect.component, finding.share, change)
        places[effect.name] = replace(place, evidence=f"{effect.kind.title}, {place.evidence}")
    if disturbances:
        foremost = disturbances[0]
        # The shares of the findings add up to the explained part of the gap's power
        # (`findings._shares`).
        share = max(1.0 - sum(finding.share for finding in attributed), 0.0)
        correlation = describe_correlation(foremost.forms)
        residual = evidence.differences(judged.plant)
        place = locate(evidence, foremost.component, share, residual, correlation)
        if all(place.component != foremost.component for place in places.values()):
            places["residual"] = place
    ordered = sorted(places.values(), key=lambda place: -place.share)
    if readings.has_unknown_controller:
        mismatch = "its commands are not those of its settings"
        ordered.append(Place("controller", 1.0, (0.0, 0.0), "throughout", mismatch))
    return ordered


def _energy(evidence: Evidence) -> dict[str, EnergyError]:
    """Energy error of each hybrid test, by file name."""
    physics = evidence.machine.physics
    errors = {
        recording.path.name: physics.energy_error(recording, configuration)
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
    }
    return {name: error for name, error in errors.items() if error is not None}


def _measure_gap(evidence: Evidence, judged: _Judged, sampled: Sequence[SensorProperty]) -> Gap:
    plant, validation = judged.plant, judged.validation
    corrected = _correct(evidence.configurations[0], plant, sampled)
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


def _closed_share(judged: _Judged) -> float:
    """Return the share of the gap that the correction closes on held-out data.

    A gap in few frequencies does not raise the rms over all of them above the floor; the closed
    share then comes from the spectral lines.
    """
    posterior, validation = judged.explanation.posterior, judged.validation
    if validation.measurable:
        return validation.held_out.value
    return posterior.closes(posterior.best) if judged.named else 0.0


def _correct(
    nominal: Configuration, plant: Plant, sampled: Sequence[SensorProperty]
) -> Configuration:
    """Settings with the corrected plant and the sensor properties that were read off signals."""
    for sensor in sampled:
        plant = with_parameters(plant, sensor.component, {sensor.parameter: sensor.value})
    return nominal._replace(plant=plant)


def _next_test(
    machine: Machine,
    explanation: Explanation,
    effects: Sequence[Finding],
    named: tuple[Effect, ...],
    tests: Sequence[Experiment],
    thresholds: Thresholds,
) -> NextTest | None:
    """Propose a test where a named effect has rivals or is uncertain."""
    ranking = explanation.posterior.ranking
    likely = [
        hypothesis.scored.fit
        for hypothesis in ranking
        if hypothesis.scored.fit.effects
        and hypothesis.weight >= thresholds.rival_weight * ranking[0].weight
    ]
    is_certain = all(
        effect.confidence >= thresholds.retest_confidence and len(effect.alternatives) == 1
        for effect in effects
    )
    if not tests or not named or is_certain or len(likely) < 2:
        return None
    return propose_test(machine, likely[:SEPARATED], tests)
