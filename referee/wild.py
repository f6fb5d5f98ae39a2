"""The check on machines whose physics differ from the library's, scored by acceptable answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from referee.score import names
from referee.score_row import ScoreRow, share_of
from referee.wild_cases import MACHINES, WildCase, draw_wild
from referee.wild_recordings import record_wild
from referee.withheld import Question, Withheld, check_machines, score_lines, seconds_row
from rigtwin.studies.sweep import Workers

SURE = 0.8
"""Confidence from which nine in ten names must be acceptable."""
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 1.0)
"""Bounds of the bins of confidence in the reliability diagram."""

WildResult = Withheld[WildCase]


@dataclass(frozen=True)
class Named:
    """A named effect.

    Attributes
    ----------
    confidence : float
        Reported confidence.
    accepted : bool
        Whether the name is acceptable.
    """

    confidence: float
    accepted: bool


def check_wild(
    folder: Path,
    count: int,
    seed: int,
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> WildResult:
    """Run the whole check with its answers stored in a folder; see `check_machines`."""

    def ask(case: WildCase) -> Question:
        return MACHINES[case.machine], [record_wild(case, again) for again in (0, 1)]

    cases = [draw_wild(number, seed) for number in range(count)]
    return check_machines(folder / f"wild-{seed}.sqlite", cases, seed, ask, workers, progress)


def judge_names(result: WildResult) -> list[Named]:
    """Return every named effect, and whether it is acceptable."""
    return [
        Named(effect["confidence"], name in case.accepted)
        for case, answer in zip(result.cases, result.answers, strict=True)
        for name, effect in zip(names(answer), answer["effects"], strict=True)
    ]


def reliability(named: Sequence[Named]) -> list[tuple[float, float, int]]:
    """Return mean confidence, share of acceptable names and count of every bin with names."""
    bins = []
    for low, high in pairwise(BINS):
        in_bin = [n for n in named if low <= n.confidence < high or n.confidence == high == 1.0]
        if in_bin:
            confidence = float(np.mean([n.confidence for n in in_bin]))
            bins.append((confidence, float(np.mean([n.accepted for n in in_bin])), len(in_bin)))
    return bins


def wild_rows(result: WildResult) -> list[ScoreRow]:
    """Return every measure of the score."""
    pairs = list(zip(result.cases, result.answers, strict=True))
    wrong = [bool(set(names(a)) - case.accepted) for case, a in pairs]
    right = [bool(a["effects"]) and not bad for (_, a), bad in zip(pairs, wrong, strict=True)]
    named = judge_names(result)
    covered = list(_intervals(result))
    return [
        share_of("a wrong family named", wrong, "<= 5 %"),
        share_of("named, and all of it acceptable", right, "none set"),
        share_of("nothing named", [not a["effects"] for _, a in pairs], "none set"),
        share_of(
            f"acceptable of names at {SURE} or more",
            [each.accepted for each in named if each.confidence >= SURE],
            ">= 90 %",
        ),
        share_of("intervals that hold the truth", covered, "90 to 98 %"),
        seconds_row(result.answers),
    ]


def _intervals(result: WildResult) -> Iterator[bool]:
    """Yield for every named effect with a true magnitude whether its interval covers it."""
    for case, answer in zip(result.cases, result.answers, strict=True):
        truth = record_wild(case).magnitudes
        for name, effect in zip(names(answer), answer["effects"], strict=True):
            if name in truth:
                interval = next(iter(effect["parameters"].values()))
                yield interval["low"] <= truth[name] <= interval["high"]


def wild_document(result: WildResult) -> dict[str, Any]:
    """Return the score as a JSON document, with the parts and the answer of every machine."""
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
    """Return the score as text."""
    lines = score_lines(result.seed, len(result.cases), wild_rows(result))
    lines += ["", "confidence said, share acceptable, names"]
    lines += [
        f"{confidence:.2f}  {true:.2f}  {count}"
        for confidence, true, count in reliability(judge_names(result))
    ]
    lines += ["", "named, and not acceptable:"]
    for case, answer in zip(result.cases, result.answers, strict=True):
        if bad := [name for name in names(answer) if name not in case.accepted]:
            lines.append(
                f"{case.number:03d} {case.machine}: {' '.join(case.parts)} -> "
                f"{' + '.join(names(answer))} (not {', '.join(bad)})"
            )
    return "\n".join(lines)
