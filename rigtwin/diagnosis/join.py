"""Join the diagnoses of a machine's independent parts to one diagnosis of the machine.

Joints that do not act on each other are diagnosed part by part. A share of a part's gap becomes a
share of the machine's gap by the part's weight w_i, with Σ w_i = 1.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from rigtwin.components.plant import Plant, select
from rigtwin.diagnosis.answer import Answer, Verdict
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.finding import Finding, Place, Step
from rigtwin.diagnosis.gap import Gap, Interval
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.shrinkage import gap_level
from rigtwin.diagnosis.text import sentence
from rigtwin.diagnosis.units import write
from rigtwin.diagnosis.words import enumerate_words

Item = TypeVar("Item")
RANKED = 2
"""Explanations of each part that enter the machine's ranking."""


def join(
    evidence: Evidence, held_out: Evidence | None, parts: Sequence[Diagnosis], started: float
) -> Diagnosis:
    """Join the diagnoses of all parts.

    Parameters
    ----------
    evidence
        Recordings of the whole machine.
    held_out
        Held-out recordings of the whole machine. None without any.
    parts
        Diagnoses of the parts. No two of them changed the same component.
    started
        Time at which the diagnosis began, s, by `time.perf_counter`.

    Returns
    -------
    Diagnosis
        Findings, places and notes of all parts, with shares of the machine's gap.
    """
    answers = [part.answer for part in parts]
    corrected = parts[0].corrected._replace(plant=_merge_plants(evidence.plant, parts))
    weights = _weights(parts)
    gap = _join_gaps(evidence, corrected.plant, answers, weights)
    effects, where = _join_effects(answers, weights), _join_places(answers, weights)
    verdict = _join_verdicts([answer.verdict for answer in answers], bool(effects))
    answer = Answer(
        verdict=verdict,
        sentence=sentence(verdict, effects, where, gap, _is_tolerated(answers)),
        effects=effects,
        where=where,
        gap=gap,
        ranking=tuple(_unique(answer.ranking[:RANKED] for answer in answers)),
        not_observable=tuple(_unique(answer.not_observable for answer in answers)),
        notes=(*_unique(answer.notes for answer in answers), *_describe_shared_delay(effects)),
        recordings=answers[0].recordings,
        seconds=time.perf_counter() - started,
        machine=evidence.machine.name,
        steps=_join_steps(answers),
        units={name: unit for answer in answers for name, unit in answer.units.items()},
        leftovers=tuple(place for answer in answers for place in answer.leftovers),
        traces=tuple(trace for answer in answers for trace in answer.traces),
        confounded=tuple(entry for answer in answers for entry in answer.confounded),
        tolerated=tuple(part for answer in answers for part in answer.tolerated),
        nearest=next((answer.nearest for answer in answers if answer.nearest), None)
        if verdict == "unknown"
        else None,
    )
    otherwise = tuple(pair for part in parts for pair in part.otherwise)
    return Diagnosis(answer, evidence.machine, evidence, corrected, otherwise, held_out)


def _is_tolerated(answers: Sequence[Answer]) -> bool:
    """Return whether what every part leaves lies within declared tolerances."""
    return all(
        answer.tolerated or answer.verdict in ("no gap", "explained") for answer in answers
    ) and any(answer.tolerated for answer in answers)


def _join_effects(answers: Sequence[Answer], weights: Sequence[float]) -> tuple[Finding, ...]:
    """Effects of all parts, with their shares of the machine's gap."""
    return tuple(
        replace(effect, share=weight * effect.share)
        for answer, weight in zip(answers, weights, strict=True)
        for effect in answer.effects
    )


def _join_places(answers: Sequence[Answer], weights: Sequence[float]) -> tuple[Place, ...]:
    """Places of all parts with their shares of the machine's gap, the largest first."""
    places = (
        replace(place, share=weight * place.share)
        for answer, weight in zip(answers, weights, strict=True)
        for place in answer.where
    )
    return tuple(sorted(places, key=lambda place: -place.share))


def _describe_shared_delay(effects: Sequence[Finding]) -> Iterator[str]:
    """Say where delays of several parts agree, as one delay of the computer would make them."""
    delays = {
        effect.name.component: effect.parameters["delay"]
        for effect in effects
        if effect.name.kind == "delay"
    }
    # Intervals of which every two overlap have a common point (Helly), between the largest low end
    # and the smallest high end.
    low = max((delay.low for delay in delays.values()), default=0.0)
    high = min((delay.high for delay in delays.values()), default=0.0)
    if len(delays) > 1 and low <= high:
        mean = sum(delay.value for delay in delays.values()) / len(delays)
        yield (
            f"the delays of {enumerate_words([*delays])} agree within their intervals: they may be "
            f"one delay of {write(mean, 's')} that all commands share"
        )


def _unique(groups: Iterable[Iterable[Item]]) -> list[Item]:
    """Items of all groups in order, without repetition."""
    return list(dict.fromkeys(item for group in groups for item in group))


def _join_steps(answers: Sequence[Answer]) -> tuple[Step, ...]:
    """Steps of all parts in sequence, each with the residuals of all signals of the machine."""
    chains = [answer.steps for answer in answers if answer.steps]
    if not chains:
        return ()
    # Every chain begins with the nominal plant, and each signal belongs to one part.
    residual = {name: value for chain in chains for name, value in chain[0].residual.items()}
    joined = [replace(chains[0][0], residual=residual)]
    for chain in chains:
        for step in chain[1:]:
            # A part's effects change its own signals; the others keep the level of the last step.
            residual = {**residual, **step.residual}
            joined.append(replace(step, residual=residual))
    return tuple(joined)


def _merge_plants(plant: Plant, parts: Sequence[Diagnosis]) -> Plant:
    """Plant with the components that any part changed."""
    changed = {
        name: component
        for part in parts
        for name, component in part.corrected.plant._asdict().items()
        if (component,) != select(plant, [name])
    }
    return plant._replace(**changed)


def _weights(parts: Sequence[Diagnosis]) -> list[float]:
    """Share of the machine's gap of each part.

    Signals are taken relative to their own amplitude. In noise floors the joint with the best
    sensor would outweigh all others.
    """
    powers = []
    for part in parts:
        evidence = part.evidence
        assert evidence is not None
        errors = relative_errors(evidence, evidence.plant)
        powers.append(len(evidence.names) * float(np.mean(np.square(errors))))
    total = max(sum(powers), 1e-300)
    return [power / total for power in powers]


def _join_verdicts(verdicts: Sequence[Verdict], named: bool) -> Verdict:
    if named:
        complete = all(verdict in ("explained", "no gap") for verdict in verdicts)
        return "explained" if complete else "partly explained"
    return "unknown" if "unknown" in verdicts else "no gap"


def _join_gaps(
    evidence: Evidence, plant: Plant, answers: Sequence[Answer], weights: Sequence[float]
) -> Gap:
    gaps = [answer.gap for answer in answers if answer.gap is not None]

    def join_shrinkage(shrinkage: Callable[[Gap], float]) -> float:
        # Amplitudes add as powers: 1 - s = sqrt(Σ w_i (1 - s_i)^2).
        remaining = sum(
            w * (1.0 - shrinkage(gap)) ** 2 for w, gap in zip(weights, gaps, strict=True)
        )
        return 1.0 - math.sqrt(remaining) if sum(weights) > 0.0 else 0.0

    return Gap(
        before=gap_level(evidence, evidence.plant),
        after=gap_level(evidence, plant),
        floor=1.0,
        shrinkage_predicted=join_shrinkage(lambda gap: gap.shrinkage_predicted),
        # All low ends together and all high ends together: wider than independent parts would give.
        shrinkage_held_out=Interval(
            join_shrinkage(lambda gap: gap.shrinkage_held_out.value),
            join_shrinkage(lambda gap: gap.shrinkage_held_out.low),
            join_shrinkage(lambda gap: gap.shrinkage_held_out.high),
        ),
        held_out=gaps[0].held_out,
        replays={name: level for gap in gaps for name, level in gap.replays.items()},
        closed_loop=None,
    )
