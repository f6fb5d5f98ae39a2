"""The check on arms with withheld defects, scored by a table of acceptable answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from referee.arm_cases import MACHINES, ArmCase, draw_arm
from referee.arm_recordings import record_arm
from referee.score import names
from referee.score_row import ScoreRow, share_of
from referee.wild_recordings import WildData
from referee.withheld import (
    Question,
    Withheld,
    check_machines,
    score_document,
    score_lines,
    seconds_row,
)
from rigtwin.studies.sweep import Workers

FLAGGED = ("unknown", "partly explained")
"""Verdicts that report an effect without a name."""

ArmResult = Withheld[ArmCase]


def check_arms(
    folder: Path,
    count: int,
    seed: int,
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> ArmResult:
    """Run the whole check with its answers stored in a folder; see `check_machines`."""

    def ask(case: ArmCase) -> Question:
        tests = [record_arm(case, again) for again in (0, 1)]
        return MACHINES[case.machine], [WildData(test.columns, test.period, {}) for test in tests]

    cases = [draw_arm(number, seed) for number in range(count)]
    return check_machines(folder / f"arm-{seed}.sqlite", cases, seed, ask, workers, progress)


def _accept_all(case: ArmCase) -> frozenset[str]:
    """Return the acceptable names of all defects of a case."""
    return frozenset(name for defect in case.defects for name in case.accept(defect))


def is_right(case: ArmCase, answer: dict[str, Any]) -> bool:
    """Return whether every defect is named, and nothing else."""
    named = set(names(answer))
    return all(case.accept(each) & named for each in case.defects) and not named - _accept_all(case)


def is_wrong(case: ArmCase, answer: dict[str, Any]) -> bool:
    """Return whether a name is not acceptable."""
    return bool(set(names(answer)) - _accept_all(case))


def _weigh_payloads(result: ArmResult) -> Iterator[float]:
    """Yield the relative mass errors of all named payloads."""
    for case, answer in zip(result.cases, result.answers, strict=True):
        if case.sort == "single" and case.defects[0][0] == "payload":
            (mass,) = record_arm(case).magnitudes
            for effect in answer["effects"]:
                if effect["kind"] == "payload":
                    yield abs(effect["parameters"]["payload"]["value"] - mass) / mass


def arm_rows(result: ArmResult) -> list[ScoreRow]:
    """Return every measure of the score."""
    pairs = list(zip(result.cases, result.answers, strict=True))

    def of_sort(sort: str) -> list[tuple[ArmCase, dict[str, Any]]]:
        return [(case, answer) for case, answer in pairs if case.sort == sort]

    errors = list(_weigh_payloads(result))
    mass_errors = (
        f"{100 * np.median(errors):.1f} % / {100 * max(errors):.1f} %" if errors else "no case"
    )
    return [
        share_of(
            "single effects: joint and kind", [is_right(*p) for p in of_sort("single")], ">= 92 %"
        ),
        share_of(
            "pairs on different joints: both", [is_right(*p) for p in of_sort("pair")], ">= 80 %"
        ),
        share_of(
            "false alarms", [a["verdict"] != "no gap" for _, a in of_sort("none")], "<= 2 in 30"
        ),
        share_of(
            "of no known form: flagged",
            [a["verdict"] in FLAGGED for _, a in of_sort("outside")],
            "none set",
        ),
        share_of("a wrong name", [is_wrong(*p) for p in pairs], "<= 5 %"),
        ScoreRow("mass of a payload, error, median / largest", mass_errors, "<= 3 %"),
        seconds_row(result.answers),
    ]


def _list_misses(result: ArmResult) -> Iterator[str]:
    """Yield one line for every wrong answer."""
    for case, answer in zip(result.cases, result.answers, strict=True):
        if case.sort == "outside":
            right = answer["verdict"] in FLAGGED and not is_wrong(case, answer)
        elif case.sort == "none":
            right = answer["verdict"] == "no gap"
        else:
            right = is_right(case, answer)
        if not right:
            defects = " + ".join(f"{word} {joint + 1}" for word, joint in case.defects) or "nothing"
            sizes = ", ".join(f"{each:.3g}" for each in record_arm(case).magnitudes)
            named = " + ".join(names(answer)) or "nothing named"
            yield (
                f"{case.number:03d} {case.machine}, {case.sort}: {defects} ({sizes or '-'}) -> "
                f"{named} [{answer['verdict']}]"
            )


def arm_document(result: ArmResult) -> dict[str, Any]:
    """Return the score as a JSON document, with the defects and the answer of every machine."""
    return score_document(result, arm_rows(result), _describe)


def _describe(case: ArmCase) -> dict[str, Any]:
    defects = [list(defect) for defect in case.defects]
    return {"machine": case.machine, "sort": case.sort, "defects": defects}


def arm_table(result: ArmResult) -> str:
    """Return the score as text."""
    lines = score_lines(result.seed, len(result.cases), arm_rows(result))
    return "\n".join([*lines, "", "not answered right:", *_list_misses(result)])
