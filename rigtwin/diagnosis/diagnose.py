"""Diagnose why recordings and the twin disagree: recordings in, one answer out.

data checks → evidence (residuals) → search for effects → validation on held-out data → location of
the residual → properties read off signals (controller, sensors) → next test → answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from threadpoolctl import threadpool_limits

from rigtwin.components import Effect
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.answer import Answer
from rigtwin.diagnosis.confounding import find_confounded
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation, candidates, explain
from rigtwin.diagnosis.finding import Finding, NextTest
from rigtwin.diagnosis.findings import describe_attributed
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.join import join
from rigtwin.diagnosis.judgement import (
    choose_verdict,
    corrected_configuration,
    judge,
    measure_gap,
)
from rigtwin.diagnosis.leftover import leftovers, steps
from rigtwin.diagnosis.next_test import propose_test
from rigtwin.diagnosis.notes import collect_notes, contact_notes
from rigtwin.diagnosis.places import locate_findings
from rigtwin.diagnosis.readings import describe_readings, read_signals
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.short_recordings import least_ticks
from rigtwin.diagnosis.text import sentence
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.tolerated import find_used_up
from rigtwin.diagnosis.traces import find_nearest, find_traces, list_unobservable
from rigtwin.diagnosis.unknown_input import locate_disturbance
from rigtwin.diagnosis.usable_data import (
    answer_unusable,
    drop_unneeded,
)
from rigtwin.recording import RecordedTest
from rigtwin.simulation.energy import EnergyError
from rigtwin.simulation.experiment import Experiment

RANKED = 8
"""Explanations in the ranking of an answer."""
SEPARATED = 4
"""Explanations that a next test should separate at most."""


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
        notes += contact_notes(machine, recordings)
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
    judged = judge(evidence, held_out, explanation, thresholds)
    named, plant = judged.named, judged.plant
    progress("locating the residual", 1)
    disturbances = locate_disturbance(evidence, plant, named) if judged.has_residual else ()
    # Noise and hum are read off the residual of the corrected twin, which the named effects no
    # longer disturb.
    readings = read_signals(evidence, plant, thresholds)
    attributed = describe_attributed(explanation, named, judged.support, evidence, thresholds)
    effects = [*attributed, *describe_readings(readings, evidence, thresholds)]
    verdict = choose_verdict(judged, readings, effects, thresholds)
    where = locate_findings(evidence, attributed, judged, disturbances, readings)
    progress("replaying components", 1)
    gap = measure_gap(evidence, judged, readings.sampled)
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
        notes=tuple(collect_notes(evidence, judged, readings, tolerated, thresholds)),
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
    corrected = corrected_configuration(evidence.configurations[0], plant, readings.sampled)
    otherwise = _other_explanations(explanation, named, thresholds.alternative_weight)
    return Diagnosis(answer, evidence.machine, evidence, corrected, otherwise, held_out)


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
