"""How the diagnosis does on machines of other physics than the library's, scored by what a person
would accept."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from referee.score import Row, names, share_of
from referee.wild_cases import MACHINES, WildCase, WildData, draw_wild, record_wild
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, Workers, run_jobs

SURE = 0.8
"""Confidence from which nine names in ten must be right."""
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 1.0)
"""Of the reliability diagram."""


@dataclass(frozen=True)
class WildResult:
    """A check. answers: what the diagnosis said, a JSON document a case."""

    seed: int
    cases: tuple[WildCase, ...]
    answers: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class Named:
    """An effect that was named. accepted: whether a person would say so too."""

    confidence: float
    accepted: bool


def check_wild(
    folder: Path,
    count: int,
    seed: int,
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> WildResult:
    """The whole check.

    Parameters
    ----------
    folder
        Where answers are kept, so that an interrupted check goes on.
    count, seed
        Of cases, and of their draw.
    workers
        Who diagnoses: they see recordings and a description, and draw nothing.
    progress
        Called with 1 for each answer.

    Returns
    -------
    WildResult
        Cases and answers.
    """
    folder.mkdir(parents=True, exist_ok=True)
    cases = tuple(draw_wild(number, seed) for number in range(count))

    def jobs() -> Iterator[tuple[str, tuple[str, list[WildData]]]]:
        for number, case in enumerate(cases):
            tests = [record_wild(case, again) for again in (0, 1)]
            yield keys[number], (MACHINES[case.machine], tests)

    keys = [f"{seed}-{number}" for number in range(count)]
    with Store(folder / f"wild-{seed}.sqlite") as store:
        run_jobs(store, workers, answer_wild, jobs(), progress)
        return WildResult(seed, cases, tuple(store[key] for key in keys))


def answer_wild(question: tuple[str, list[WildData]]) -> dict[str, Any]:
    """One case's answer, of a recording and one held out. What is not answered at all is an answer
    too."""
    from rigtwin.description.catalogue import find
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.recording import Recording

    name, tests = question
    machine = find(name)

    def load(data: WildData, label: str) -> Recording:
        ticks = len(next(iter(next(iter(data.columns.values())).values())))
        times = np.arange(ticks) * data.period
        return Recording(Path(label), machine.name, "", data.period, times, data.columns, {})

    began = time.perf_counter()
    fitted, held_out = (load(data, label) for data, label in zip(tests, "ab", strict=True))
    try:
        return diagnose(machine, [fitted], held_out=[held_out]).document()
    except RigtwinError as error:
        seconds = time.perf_counter() - began
        return {"verdict": "unusable", "effects": [], "sentence": str(error), "seconds": seconds}


def judge_names(result: WildResult) -> list[Named]:
    """Every effect that was named, and whether it is accepted."""
    return [
        Named(effect["confidence"], name in case.accepted)
        for case, answer in zip(result.cases, result.answers, strict=True)
        for name, effect in zip(names(answer), answer["effects"], strict=True)
    ]


def reliability(named: Sequence[Named]) -> list[tuple[float, float, int]]:
    """(mean confidence, share accepted, how many) in bins of confidence."""
    found = []
    for low, high in pairwise(BINS):
        own = [n for n in named if low <= n.confidence < high or n.confidence == high == 1.0]
        if own:
            said = float(np.mean([n.confidence for n in own]))
            found.append((said, float(np.mean([n.accepted for n in own])), len(own)))
    return found


def wild_rows(result: WildResult) -> list[Row]:
    """Every measure."""
    pairs = list(zip(result.cases, result.answers, strict=True))
    wrong = [bool(set(names(a)) - case.accepted) for case, a in pairs]
    right = [bool(a["effects"]) and not bad for (_, a), bad in zip(pairs, wrong, strict=True)]
    named = judge_names(result)
    held = list(_intervals(result))
    seconds = [a["seconds"] for _, a in pairs]
    return [
        share_of("a wrong family named", wrong, "<= 5 %"),
        share_of("named, and all of it acceptable", right, "none set"),
        share_of("nothing named", [not a["effects"] for _, a in pairs], "none set"),
        share_of(
            f"acceptable of names at {SURE} or more",
            [each.accepted for each in named if each.confidence >= SURE],
            ">= 90 %",
        ),
        share_of("intervals that hold the truth", held, "90 to 98 %"),
        Row(
            "seconds a case, median / largest", f"{np.median(seconds):.1f} / {max(seconds):.1f}", ""
        ),
    ]


def _intervals(result: WildResult) -> Iterator[bool]:
    for case, answer in zip(result.cases, result.answers, strict=True):
        truth = record_wild(case).magnitudes
        for name, effect in zip(names(answer), answer["effects"], strict=True):
            if name in truth:
                each = next(iter(effect["parameters"].values()))
                yield each["low"] <= truth[name] <= each["high"]


def wild_document(result: WildResult) -> dict[str, Any]:
    """The score for other programs, with what was there and what was said of each machine."""
    return {
        "seed": result.seed,
        "cases": len(result.cases),
        "rows": [asdict(row) for row in wild_rows(result)],
        "reliability": reliability(judge_names(result)),
        "machines": [
            {
                "machine": case.machine,
                "parts": case.parts,
                "accepted": sorted(case.accepted),
                "named": names(answer),
                "verdict": answer["verdict"],
                "effects": answer["effects"],
            }
            for case, answer in zip(result.cases, result.answers, strict=True)
        ],
    }


def wild_table(result: WildResult) -> str:
    """The score as text."""
    lines = [f"seed {result.seed}, {len(result.cases)} machines", ""]
    for row in wild_rows(result):
        interval = ""
        if row.low is not None and row.high is not None:
            interval = f"[{100 * row.low:.0f} to {100 * row.high:.0f} %]"
        lines.append(f"{row.measure:40s} {row.value:24s} {interval:16s} {row.goal}".rstrip())
    lines += ["", "confidence said, share acceptable, names"]
    lines += [
        f"{said:.2f}  {true:.2f}  {count}" for said, true, count in reliability(judge_names(result))
    ]
    lines += ["", "named, and not acceptable:"]
    for case, answer in zip(result.cases, result.answers, strict=True):
        if bad := [name for name in names(answer) if name not in case.accepted]:
            lines.append(
                f"{case.number:03d} {case.machine}: {' '.join(case.parts)} -> "
                f"{' + '.join(names(answer))} (not {', '.join(bad)})"
            )
    return "\n".join(lines)
