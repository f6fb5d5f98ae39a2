"""The answers to a machine's parts as one answer to the whole."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.cross_validation import gap_level
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.finding import Answer, Gap, Interval, Step, Verdict
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.text import sentence

Item = TypeVar("Item")
FIRST = 2
"""Explanations of each part that the whole's ranking has."""


def join(
    evidence: Evidence, held_out: Evidence | None, found: Sequence[Diagnosis], started: float
) -> Diagnosis:
    """The diagnosis of a machine whose parts were diagnosed each by itself.

    Parameters
    ----------
    evidence
        Of the whole machine.
    held_out
        The same of the recordings that it was judged on, None without any.
    found
        Of its parts, which share no component that was changed.
    started
        When the diagnosis began, as `time.perf_counter` has it.

    Returns
    -------
    Diagnosis
        Findings, places and notes of all parts; shares are of the whole gap.
    """
    answers = [each.answer for each in found]
    corrected = found[0].corrected._replace(plant=_merge(evidence.plant, found))
    weights = _weights(found)
    gap = _join_gaps(evidence, corrected.plant, answers, weights)
    effects = tuple(
        replace(effect, share=weight * effect.share)
        for answer, weight in zip(answers, weights, strict=True)
        for effect in answer.effects
    )
    where = sorted(
        (
            replace(place, share=weight * place.share)
            for answer, weight in zip(answers, weights, strict=True)
            for place in answer.where
        ),
        key=lambda place: -place.share,
    )
    verdict = _join_verdicts([answer.verdict for answer in answers], bool(effects))
    answer = Answer(
        verdict=verdict,
        sentence=sentence(verdict, effects, where, gap),
        effects=effects,
        where=tuple(where),
        gap=gap,
        ranking=tuple(_chain(answer.ranking[:FIRST] for answer in answers)),
        not_observable=tuple(_chain(answer.not_observable for answer in answers)),
        notes=tuple(_chain(answer.notes for answer in answers)),
        recordings=answers[0].recordings,
        seconds=time.perf_counter() - started,
        machine=evidence.machine.name,
        steps=_join_steps(answers),
        units={name: unit for answer in answers for name, unit in answer.units.items()},
        leftovers=tuple(place for answer in answers for place in answer.leftovers),
        traces=tuple(trace for answer in answers for trace in answer.traces),
        nearest=next((answer.nearest for answer in answers if answer.nearest), None)
        if verdict == "unknown"
        else None,
    )
    otherwise = tuple(pair for each in found for pair in each.otherwise)
    return Diagnosis(answer, evidence.machine, evidence, corrected, otherwise, held_out)


def _chain(groups: Iterable[Iterable[Item]]) -> list[Item]:
    """All of them in order, each once."""
    return list(dict.fromkeys(item for group in groups for item in group))


def _join_steps(answers: Sequence[Answer]) -> tuple[Step, ...]:
    """What each part's effects leave of all signals, part after part, the nominal machine first."""
    chains = [answer.steps for answer in answers if answer.steps]
    if not chains:
        return ()
    left = {name: value for chain in chains for name, value in chain[0].left.items()}
    found = [replace(chains[0][0], left=left)]
    for chain in chains:
        for step in chain[1:]:
            left = {**left, **step.left}
            found.append(replace(step, left=left))
    return tuple(found)


def _merge(plant: Plant, found: Sequence[Diagnosis]) -> Plant:
    """The plant with what each part changed of it."""
    changed = {
        name: component
        for each in found
        for name, component in each.corrected.plant._asdict().items()
        if component != getattr(plant, name)
    }
    return plant._replace(**changed)


def _weights(found: Sequence[Diagnosis]) -> list[float]:
    """Each part's share of the whole gap, its signals in units of their own: noise differs too much
    from joint to joint to compare them by it."""
    powers = []
    for each in found:
        evidence = each.evidence
        assert evidence is not None
        errors = relative_errors(evidence, evidence.plant)
        powers.append(len(evidence.names) * float(np.mean(np.square(errors))))
    whole = max(sum(powers), 1e-300)
    return [power / whole for power in powers]


def _join_verdicts(verdicts: Sequence[Verdict], named: bool) -> Verdict:
    if named:
        whole = all(verdict in ("explained", "no gap") for verdict in verdicts)
        return "explained" if whole else "partly explained"
    return "unknown" if "unknown" in verdicts else "no gap"


def _join_gaps(
    evidence: Evidence, plant: Plant, answers: Sequence[Answer], weights: Sequence[float]
) -> Gap:
    gaps = [answer.gap for answer in answers if answer.gap is not None]

    def shrink(of: Callable[[Gap], float]) -> float:
        left = sum(w * (1.0 - of(gap)) ** 2 for w, gap in zip(weights, gaps, strict=True))
        return 1.0 - math.sqrt(left) if sum(weights) > 0.0 else 0.0

    return Gap(
        before=gap_level(evidence, evidence.plant),
        after=gap_level(evidence, plant),
        floor=1.0,
        shrinkage_predicted=shrink(lambda gap: gap.shrinkage_predicted),
        # Each part's ends together: wider than what chance would make of their sum.
        shrinkage_held_out=Interval(
            shrink(lambda gap: gap.shrinkage_held_out.value),
            shrink(lambda gap: gap.shrinkage_held_out.low),
            shrink(lambda gap: gap.shrinkage_held_out.high),
        ),
        held_out=gaps[0].held_out,
        replays={name: level for gap in gaps for name, level in gap.replays.items()},
        closed_loop=None,
    )
