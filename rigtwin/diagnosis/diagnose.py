"""The diagnosis: recordings in, one answer out.

checks → evidence → attribution (replays of the whole plant) and what needs no model (controller,
sensors' sampling) → where → judged on held-out data → the next test.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from rigtwin.components import Effect, with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine
from rigtwin.diagnosis.controller import ControllerReplay, Deviation
from rigtwin.diagnosis.copies import drop_copies, refuse_copies
from rigtwin.diagnosis.cross_validation import Validation, gap_level, validate, with_effects
from rigtwin.diagnosis.data_checks import SHORTEST, SHORTEST_PART, find_faults, require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation, explain
from rigtwin.diagnosis.finding import (
    Answer,
    Finding,
    Gap,
    NextTest,
    Place,
    Verdict,
)
from rigtwin.diagnosis.findings import (
    choose_named,
    describe_attributed,
    describe_controller,
    describe_sensor,
    describe_slight,
    find_nearest,
    find_traces,
    list_unobservable,
    supports,
)
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.join import join
from rigtwin.diagnosis.leftover import leftovers, steps
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.next_test import propose_test
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.sampling import SensorProperty, find_outstanding
from rigtwin.diagnosis.short_recordings import drop_short, least_ticks
from rigtwin.diagnosis.stops import find_cut_commands, find_stops
from rigtwin.diagnosis.text import sentence
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.unknown_input import DisturbanceFit, locate_disturbance
from rigtwin.diagnosis.words import enumerate_words
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.simulation.energy import EnergyError
from rigtwin.simulation.experiment import Experiment


def _answer_unusable(
    machine: Machine,
    recordings: Sequence[Recording],
    configurations: Sequence[Configuration],
    started: float,
) -> Answer | None:
    """The answer if some data are not fit to be diagnosed, else None."""
    faults = [
        f"{recording.path}: {fault.message}"
        for recording, configuration in zip(recordings, configurations, strict=True)
        for fault in find_faults(machine, recording, configuration, least_ticks(recordings))
        if fault.fatal
    ]
    total = sum(recording.ticks for recording in recordings)
    if len(recordings) > 1 and total < SHORTEST:
        faults.insert(
            0, f"the recordings have {total} ticks together; a diagnosis needs at least {SHORTEST}"
        )
    if not faults:
        return None
    return Answer(
        verdict="unusable",
        sentence=f"The data cannot be diagnosed: {faults[0]}.",
        faults=tuple(faults),
        notes=_notes(recordings),
        recordings=tuple(str(recording.path) for recording in recordings),
        seconds=time.perf_counter() - started,
        machine=machine.name,
    )


def _notes(recordings: Sequence[Recording]) -> tuple[str, ...]:
    return tuple(
        f"{recording.path.name}: {note}" for recording in recordings for note in recording.notes
    )


def diagnose(
    machine: Machine,
    recordings: Sequence[Recording],
    base: Configuration | None = None,
    held_out: Sequence[Recording] = (),
    tests: Sequence[Experiment] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
    thresholds: Thresholds = STANDARD,
    first_look: Callable[[FirstLook], object] = lambda _: None,
) -> Diagnosis:
    """Says why recordings of one machine and its twin disagree.

    Parameters
    ----------
    machine
        Its description.
    recordings
        Explained together.
    base
        The twin that they are compared with; by default the described one.
    held_out
        Recordings that the correction is judged on; without any, each half of the others on a fit
        to the other half.
    tests
        The menu that a next test is chosen from.
    progress
        Called with a stage's name and the steps done in it.
    thresholds
        What the stages hold their figures against.
    first_look
        Called as soon as every effect has been tried: what the gap is, and its suspects; of a
        machine of several joints that do not act on each other, once for each.

    Returns
    -------
    Diagnosis
        The answer, and the corrected twin.

    Raises
    ------
    RigtwinError
        If the recordings' settings are unknown here, or held-out data are not fit to be compared or
        the same as those of the fit.
    """
    started = time.perf_counter()
    recordings, copies = drop_copies(recordings)
    refuse_copies(held_out, recordings)
    recordings, short = drop_short(recordings)
    held_out, short_held_out = drop_short(held_out)
    left_out = [*copies, *short, *short_held_out]
    with threadpool_limits(1):
        configurations = [machine.configuration_of(recording, base) for recording in recordings]
        if (bad := _answer_unusable(machine, recordings, configurations, started)) is not None:
            return Diagnosis(bad, machine, None, configurations[0])
        others = [machine.configuration_of(recording, base) for recording in held_out]
        for recording, configuration in zip(held_out, others, strict=True):
            require_fit(machine, recording, configuration, least_ticks(held_out))

        def diagnose_part(part: Machine) -> Diagnosis:
            evidence = Evidence(part, recordings, configurations)
            apart = Evidence(part, held_out, others) if held_out else None
            return _diagnose(
                evidence=evidence,
                held_out=apart,
                tests=tests,
                progress=progress,
                first_look=first_look,
                thresholds=thresholds,
                started=started,
            )

        found = [diagnose_part(part) for part in machine.physics.split(machine)]
        if len(found) == 1:
            return _with_notes(found[0], left_out)
        apart = Evidence(machine, held_out, others) if held_out else None
        joined = join(Evidence(machine, recordings, configurations), apart, found, started)
        return _with_notes(joined, left_out)


def _with_notes(diagnosis: Diagnosis, notes: Sequence[str]) -> Diagnosis:
    answer = replace(diagnosis.answer, notes=(*notes, *diagnosis.answer.notes))
    return replace(diagnosis, answer=answer)


def _diagnose(
    evidence: Evidence,
    held_out: Evidence | None,
    tests: Sequence[Experiment],
    progress: Callable[[str, int], object],
    first_look: Callable[[FirstLook], object],
    thresholds: Thresholds,
    started: float,
) -> Diagnosis:
    found = explain(
        evidence, lambda steps: progress("fitting effects", steps), thresholds, first_look
    )
    support = supports(found, evidence, thresholds)
    named = choose_named(found, support, thresholds)
    progress("judging on held-out data", 1)
    validation = validate(evidence, found.fit, named, found.posterior, held_out, thresholds)
    kept = validation.accepted
    left = _leaves_something(found, kept)
    notes = [*_notes(evidence.recordings), *_clipping_notes(evidence)]
    notes += find_stops(evidence.machine, evidence.recordings)
    notes += find_cut_commands(evidence.machine, evidence.recordings)
    if validation.rejected:
        names = " and ".join(effect.name for effect in validation.rejected)
        notes.append(f"{names} rejected: held-out data became worse with it")
    if kept and left and validation.largest < thresholds.removed_share:
        names = " and ".join(effect.name for effect in kept)
        share = f"{100 * validation.largest:.0f} %"
        notes.append(f"{names} not named: it closes at most {share} of any signal's gap")
        kept = ()
    plant = with_effects(evidence.plant, found.fit, kept)
    progress("looking where", 1)
    disturbed = locate_disturbance(evidence, plant, kept) if left else ()
    deviations = _deviations(evidence)
    slight = [
        each
        for each in deviations
        if each.kind in ("setting", "unknown")
        and each.consequence < thresholds.controller_consequence
    ]
    notes += [describe_slight(each) for each in slight]
    deviations = [each for each in deviations if each not in slight]
    sampled = find_outstanding(
        evidence.machine, evidence.recordings, evidence.predict(plant), evidence.plant
    )
    attributed = describe_attributed(found, kept, support, evidence, thresholds)
    effects = [
        *attributed,
        *(describe_sensor(each, evidence, thresholds.highest_confidence) for each in sampled),
        *(
            describe_controller(each, thresholds.highest_confidence)
            for each in deviations
            if each.kind != "unknown"
        ),
    ]
    odd_controller = any(each.kind == "unknown" for each in deviations)
    rest = left or odd_controller
    closed = found.posterior.closes(found.posterior.best)
    if validation.measurable:
        closed = validation.held_out.value
    closes = not kept or closed >= thresholds.explained_share
    verdict: Verdict
    if effects:
        verdict = "explained" if closes and not rest else "partly explained"
    else:
        verdict = "unknown" if rest else "no gap"
    where = _places(evidence, attributed, plant, kept, disturbed, found.fit)
    if odd_controller:
        where.append(
            Place(
                "controller",
                1.0,
                (0.0, 0.0),
                "throughout",
                "its commands are not those of its settings",
            )
        )
    progress("replaying components", 1)
    gap = _gap(evidence, plant, validation, sampled)
    progress("choosing the next test", 1)
    suggestion = _next_test(evidence.machine, found, effects, kept, tests, thresholds)
    corrected = _correct(evidence.configurations[0], plant, sampled)
    gone = verdict == "no gap"
    answer = Answer(
        verdict=verdict,
        sentence=sentence(verdict, effects, where, gap),
        effects=tuple(effects),
        where=tuple(where),
        gap=gap,
        ranking=tuple((each.scored.fit.name, each.weight) for each in found.posterior.ranking[:8]),
        next_test=suggestion,
        not_observable=list_unobservable(found, attributed),
        notes=tuple(notes),
        recordings=tuple(str(recording.path) for recording in evidence.recordings),
        seconds=time.perf_counter() - started,
        machine=evidence.machine.name,
        steps=steps(evidence, () if gone else found.chain, held_out or evidence),
        units={row.name: row.unit for row in evidence.machine.rows},
        leftovers=tuple(leftovers(evidence, plant, disturbed, thresholds)) if disturbed else (),
        traces=() if gone else find_traces(found, kept, evidence, thresholds),
        nearest=find_nearest(found, evidence) if verdict == "unknown" else None,
        energy=_energy(evidence),
    )
    return Diagnosis(
        answer,
        evidence.machine,
        evidence,
        corrected,
        _alternatives(found, kept, thresholds.alternative_weight),
        held_out,
    )


def _leaves_something(found: Explanation, kept: Sequence[Effect]) -> bool:
    """Whether more than noise and declared error is left once the kept effects are corrected."""
    posterior = found.posterior
    if set(kept) == set(posterior.best.fit.effects):
        return posterior.has_unexplained_residual
    known = [each.scored for each in posterior.ranking if set(each.scored.fit.effects) == set(kept)]
    # What was fitted and is not named leaves what it explained.
    scored = known[0] if known else posterior.empty
    left = posterior.loss(scored) - posterior.loss(posterior.best) + posterior.unexplained
    return left > posterior.prices.ordinary


def _alternatives(
    found: Explanation, kept: Sequence[Effect], least: float
) -> tuple[tuple[Fit, float], ...]:
    """Explanations other than the one that is named, of that weight at least, the best first."""
    return tuple(
        (each.scored.fit, each.weight)
        for each in found.posterior.ranking
        if each.scored.fit.effects
        and set(each.scored.fit.effects) != set(kept)
        and each.weight >= least
    )


def _clipping_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {fault.message}; those ticks are left out"
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
        for fault in find_faults(evidence.machine, recording, configuration, SHORTEST_PART)
        if not fault.fatal
    ]


def _deviations(evidence: Evidence) -> list[Deviation]:
    """What the controller did other than told, once for all recordings."""
    found: dict[tuple[str, str], Deviation] = {}
    for recording, configuration in zip(evidence.recordings, evidence.configurations, strict=True):
        control = evidence.machine.control
        told = recording.controller or (control is not None and control.exact is not None)
        if control is None or not told or OWN in recording.controller:
            # Nobody said what the controller was told to do, or it was another.
            continue
        deviation = ControllerReplay(control, recording, configuration.controller).deviation()
        if deviation is not None:
            found[deviation.kind, deviation.name] = deviation
    return list(found.values())


def _places(
    evidence: Evidence,
    attributed: Sequence[Finding],
    plant: Plant,
    kept: tuple[Effect, ...],
    disturbed: tuple[DisturbanceFit, ...],
    fit: Fit,
) -> list[Place]:
    """Where the named effects act, and where the rest lies."""
    places: dict[str, Place] = {}
    own = evidence.predict(plant)
    for effect, finding in zip(
        [each for each in fit.effects if each in kept], attributed, strict=True
    ):
        without = with_effects(evidence.plant, fit, [other for other in kept if other != effect])
        change: list[Array] = [a - b for a, b in zip(own, evidence.predict(without), strict=True)]
        place = locate(evidence, effect.component, finding.share, change)
        places[effect.name] = replace(place, evidence=f"{effect.kind.title}: {place.evidence}")
    if disturbed:
        foremost = disturbed[0]
        share = max(1.0 - sum(finding.share for finding in attributed), 0.0)
        words = (
            "what is left goes with " + enumerate_words(foremost.forms)
            if foremost.forms
            else "what is left has no plain form"
        )
        left = evidence.differences(plant)
        place = locate(evidence, foremost.component, share, left, words)
        if all(place.component != foremost.component for place in places.values()):
            places["left"] = place
    return sorted(places.values(), key=lambda place: -place.share)


def _energy(evidence: Evidence) -> dict[str, EnergyError]:
    physics = evidence.machine.physics
    measured = {
        recording.path.name: physics.energy_error(recording, configuration)
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
    }
    return {name: each for name, each in measured.items() if each is not None}


def _gap(
    evidence: Evidence, plant: Plant, outcome: Validation, sampled: Sequence[SensorProperty]
) -> Gap:
    corrected = _correct(evidence.configurations[0], plant, sampled)
    replays, loop = evidence.machine.physics.levels(evidence, plant, corrected)
    return Gap(
        before=gap_level(evidence, evidence.plant),
        after=gap_level(evidence, plant),
        floor=1.0,
        shrinkage_predicted=outcome.predicted,
        shrinkage_held_out=outcome.held_out,
        held_out=outcome.data,
        replays=replays,
        closed_loop=loop,
    )


def _correct(
    nominal: Configuration, plant: Plant, sampled: Sequence[SensorProperty]
) -> Configuration:
    for each in sampled:
        plant = with_parameters(plant, each.component, {each.parameter: each.value})
    return nominal._replace(plant=plant)


def _next_test(
    machine: Machine,
    found: Explanation,
    effects: Sequence[Finding],
    kept: tuple[Effect, ...],
    tests: Sequence[Experiment],
    thresholds: Thresholds,
) -> NextTest | None:
    ranking = found.posterior.ranking
    likely = [
        each.scored.fit
        for each in ranking
        if each.scored.fit.effects and each.weight >= thresholds.rival_weight * ranking[0].weight
    ]
    sure = all(
        effect.confidence >= thresholds.retest_confidence and len(effect.alternatives) == 1
        for effect in effects
    )
    if not tests or not kept or sure or len(likely) < 2:
        return None
    return propose_test(machine, likely[:4], tests)
