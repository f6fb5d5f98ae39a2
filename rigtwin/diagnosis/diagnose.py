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
from rigtwin.description.machine import OWN, Machine, Structure
from rigtwin.description.parts import parts
from rigtwin.diagnosis.attribute import Attribution, attribute, prefer_held_out
from rigtwin.diagnosis.controller import ControllerReplay, Deviation
from rigtwin.diagnosis.cross_validation import Validation, gap_level, validate, with_effects
from rigtwin.diagnosis.data_checks import find_faults, require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import (
    Answer,
    Finding,
    Gap,
    NextTest,
    Place,
    Verdict,
)
from rigtwin.diagnosis.findings import (
    describe_attributed,
    describe_controller,
    describe_sensor,
    describe_slight,
    find_nearest,
    find_traces,
    list_unobservable,
)
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.join import join
from rigtwin.diagnosis.leftover import leftovers, steps
from rigtwin.diagnosis.levels import compute_levels
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.next_test import propose_test
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.sampling import SensorProperty, find_outstanding
from rigtwin.diagnosis.stops import find_cut_commands, find_stops
from rigtwin.diagnosis.text import sentence
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.unknown_input import DisturbanceFit, locate_disturbance
from rigtwin.diagnosis.words import enumerate_words
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.simulation.energy import EnergyError, measure_energy
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
        for fault in find_faults(machine, recording, configuration)
        if fault.fatal
    ]
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
        If the recordings' settings are unknown here, or held-out data are not fit to be compared.
    """
    started = time.perf_counter()
    with threadpool_limits(1):
        configurations = [machine.configuration_of(recording, base) for recording in recordings]
        if (bad := _answer_unusable(machine, recordings, configurations, started)) is not None:
            return Diagnosis(bad, machine, None, configurations[0])
        others = [machine.configuration_of(recording, base) for recording in held_out]
        for recording, configuration in zip(held_out, others, strict=True):
            require_fit(machine, recording, configuration)

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

        found = [diagnose_part(part) for part in parts(machine)]
        if len(found) == 1:
            return found[0]
        apart = Evidence(machine, held_out, others) if held_out else None
        return join(Evidence(machine, recordings, configurations), apart, found, started)


def _diagnose(
    evidence: Evidence,
    held_out: Evidence | None,
    tests: Sequence[Experiment],
    progress: Callable[[str, int], object],
    first_look: Callable[[FirstLook], object],
    thresholds: Thresholds,
    started: float,
) -> Diagnosis:
    def fitted(steps: int) -> None:
        progress("fitting effects", steps)

    found = attribute(evidence, fitted, thresholds, first_look)
    if held_out is not None:
        found = prefer_held_out(found, evidence, held_out, thresholds)
    best = found.best.fit if found.best is not None else _nothing(found, evidence)
    stops = [
        *find_stops(evidence.machine, evidence.recordings),
        *find_cut_commands(evidence.machine, evidence.recordings),
    ]
    notes = [*_notes(evidence.recordings), *_clipping_notes(evidence), *stops]
    progress("judging on held-out data", 1)
    validation = validate(evidence, best, held_out, thresholds)
    if validation.fit is not None:
        best = validation.fit
    if validation.rejected:
        names = " and ".join(effect.name for effect in validation.rejected)
        notes.append(f"{names} rejected: held-out data became worse with it")
    if validation.idle:
        names = " and ".join(effect.name for effect in validation.idle)
        notes.append(f"{names} not named: it closes nothing of the gap on held-out data")
    plant = with_effects(evidence.plant, best, validation.kept)
    progress("looking where", 1)
    disturbed = locate_disturbance(evidence, plant, validation.kept, follow=found.unknown)
    most = (1.0 + thresholds.unexplained) * found.expected
    something = (
        found.unknown
        # What was taken for a gap by chance, and is rejected, leaves none.
        or (bool(validation.rejected) and found.nothing.misfit > most)
        or disturbed[0].gained > thresholds.something * found.expected
    )
    if something and (instead := _find_instead(evidence, validation.kept, most)):
        names = " and ".join(effect.name for effect in validation.kept)
        notes.append(
            f"{names} not named: something without a name at {instead[0].component} explains "
            "these data without it"
        )
        best, plant, disturbed = _nothing(found, evidence), evidence.plant, instead
        validation = validate(evidence, best, held_out, thresholds)
    deviations = _deviations(evidence)
    slight = [
        each
        for each in deviations
        if each.kind in ("setting", "unknown") and each.consequence < thresholds.consequence
    ]
    notes += [describe_slight(each) for each in slight]
    deviations = [each for each in deviations if each not in slight]
    sampled = find_outstanding(
        evidence.machine, evidence.recordings, evidence.predict(plant), evidence.plant
    )
    attributed = describe_attributed(found, validation, evidence, thresholds)
    traces = find_traces(found, evidence, thresholds)
    effects = [
        *attributed,
        *(describe_sensor(each, evidence, thresholds.sure) for each in sampled),
        *(
            describe_controller(each, thresholds.sure)
            for each in deviations
            if each.kind != "unknown"
        ),
    ]
    odd_controller = any(each.kind == "unknown" for each in deviations)
    verdict: Verdict
    if effects:
        verdict = "partly explained" if something or odd_controller else "explained"
    else:
        verdict = "unknown" if something or odd_controller else "no gap"
    where = _places(evidence, found, plant, validation.kept, disturbed if something else (), best)
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
    suggestion = _next_test(evidence.machine, found, effects, validation.kept, tests, thresholds)
    corrected = _correct(evidence.configurations[0], plant, sampled)
    rough = evidence.machine.rough
    gone = verdict == "no gap"
    answer = Answer(
        verdict=verdict,
        sentence=sentence(verdict, effects, where, gap),
        effects=tuple(effects),
        where=tuple(where),
        gap=gap,
        ranking=tuple(
            (" + ".join(each.names) or "none", each.probability) for each in found.ranking[:8]
        ),
        next_test=suggestion,
        not_observable=list_unobservable(found, attributed),
        notes=tuple(notes),
        recordings=tuple(str(recording.path) for recording in evidence.recordings),
        seconds=time.perf_counter() - started,
        machine=evidence.machine.name,
        steps=steps(evidence, () if gone else found.chain, held_out or evidence) if rough else (),
        units={row.name: row.unit for row in evidence.machine.rows},
        leftovers=tuple(leftovers(evidence, plant, disturbed, thresholds))
        if rough and not gone
        else (),
        traces=traces,
        nearest=find_nearest(found) if verdict == "unknown" else None,
        energy=_energy(evidence),
    )
    return Diagnosis(
        answer,
        evidence.machine,
        evidence,
        corrected,
        _alternatives(found, validation.kept, thresholds.possible),
        held_out,
    )


def _nothing(found: Attribution, evidence: Evidence) -> Fit:
    """That nothing is named."""
    return Fit((), (), found.nothing.misfit, (), evidence.plant)


def _find_instead(
    evidence: Evidence, kept: Sequence[Effect], most: float
) -> tuple[DisturbanceFit, ...] | None:
    """What explains a known machine without the effects that would be named beside something else:
    something at the component of one of them alone, up to a χ² of `most`. Then they only have a
    part of its form, as an offset has of a drift. None if nothing does."""
    if not kept or evidence.machine.rough:
        return None
    alone = locate_disturbance(evidence, evidence.plant)
    at_one = alone[0].component in {effect.component for effect in kept}
    return alone if at_one and alone[0].misfit < most else None


def _alternatives(
    found: Attribution, kept: Sequence[Effect], least: float
) -> tuple[tuple[Fit, float], ...]:
    """Explanations other than the one that is named, of that probability at least, the
    likeliest first."""
    others = [
        each for each in found.ranking if each.fit.effects and set(each.fit.effects) != set(kept)
    ]
    return tuple((each.fit, each.probability) for each in others if each.probability >= least)


def _clipping_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {fault.message}; those ticks are left out"
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
        for fault in find_faults(evidence.machine, recording, configuration)
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
    found: Attribution,
    plant: Plant,
    kept: tuple[Effect, ...],
    disturbed: tuple[DisturbanceFit, ...],
    best: Fit,
) -> list[Place]:
    places: dict[str, Place] = {}
    own = evidence.predict(plant)
    for effect in kept:
        without = with_effects(evidence.plant, best, [other for other in kept if other != effect])
        change: list[Array] = [a - b for a, b in zip(own, evidence.predict(without), strict=True)]
        share = min(max(found.shares.get(effect.name, found.explained), 0.0), 1.0)
        place = locate(evidence, effect.component, share, change)
        places[effect.name] = replace(place, evidence=f"{effect.kind.title}: {place.evidence}")
    if disturbed:
        foremost = disturbed[0]
        share = 1.0 - (found.explained if kept else 0.0)
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
    measured = {
        recording.path.name: measure_energy(recording, configuration)
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
        if evidence.machine.structure is Structure.QUARTER_CAR
    }
    return {name: each for name, each in measured.items() if each is not None}


def _gap(
    evidence: Evidence, plant: Plant, outcome: Validation, sampled: Sequence[SensorProperty]
) -> Gap:
    corrected = _correct(evidence.configurations[0], plant, sampled)
    replays, loop = compute_levels(evidence, plant, corrected)
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
    found: Attribution,
    effects: Sequence[Finding],
    kept: tuple[Effect, ...],
    tests: Sequence[Experiment],
    thresholds: Thresholds,
) -> NextTest | None:
    if not tests or found.best is None or not kept:
        return None
    likely = [
        each.fit
        for each in found.ranking
        if each.fit.effects and each.probability >= thresholds.member
    ]
    if (
        all(
            effect.confidence >= thresholds.unsure and len(effect.alternatives) == 1
            for effect in effects
        )
        or len(likely) < 2
    ):
        return None
    return propose_test(
        machine, [found.best.fit, *(fit for fit in likely if fit is not found.best.fit)][:4], tests
    )
