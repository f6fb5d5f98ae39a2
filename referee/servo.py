"""The check on servos with withheld defects, scored by a table of acceptable answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from referee.score import names
from referee.score_row import ScoreRow, share_of
from referee.servo_cases import DESCRIPTION, NOMINAL, ServoCase, draw_servo, record_servo
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

ServoResult = Withheld[ServoCase]
VALUES = {
    ("coulomb", "joint"): "coulomb",
    ("delay", "servo"): "delay",
    ("position_gain", "servo"): "stiffness",
    ("gains", "servo"): "factor",
    ("backlash", "servo"): "play",
}
"""Kind and component of an effect → attribute of the truth that its first value states."""


def check_servos(
    folder: Path,
    count: int,
    seed: int,
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> ServoResult:
    """Run the whole check with its answers stored in a folder; see `check_machines`."""

    def ask(case: ServoCase) -> Question:
        tests = [record_servo(case, again) for again in (0, 1)]
        return DESCRIPTION, [WildData(test.columns, test.period, {}) for test in tests]

    cases = [draw_servo(number, seed) for number in range(count)]
    return check_machines(folder / f"servo-{seed}.sqlite", cases, seed, ask, workers, progress)


def is_right(case: ServoCase, answer: dict[str, Any]) -> bool:
    """Return whether every defect is named, and nothing else."""
    named = set(names(answer))
    return all(named & demanded for demanded in case.demanded) and named <= case.accepted


def servo_rows(result: ServoResult) -> list[ScoreRow]:
    """Return every measure of the score."""
    pairs = list(zip(result.cases, result.answers, strict=True))

    def answers_with(count: int) -> list[bool]:
        return [is_right(*pair) for pair in pairs if len(pair[0].defects) == count]

    return [
        share_of("single defects: all named, nothing else", answers_with(1), ">= 92 %"),
        share_of("two and three: all named, nothing else", answers_with(2) + answers_with(3), ""),
        share_of(
            "false alarms",
            [answer["verdict"] != "no gap" for case, answer in pairs if not case.defects],
            "<= 2 in 30",
        ),
        share_of(
            "a wrong name",
            [bool(set(names(answer)) - case.accepted) for case, answer in pairs],
            "<= 5 %",
        ),
        share_of("values within 10 % of the truth", list(_judge_values(result)), ""),
        seconds_row(result.answers),
    ]


def _judge_values(result: ServoResult) -> Iterator[bool]:
    """Yield for every value of a named defect whether it is within 10 % of the truth."""
    for case, answer in zip(result.cases, result.answers, strict=True):
        truth = record_servo(case).truth
        for effect in answer["effects"]:
            attribute = VALUES.get((effect["kind"], effect["component"]))
            if attribute is not None and f"{effect['kind']}@{effect['component']}" in case.accepted:
                true = (
                    truth.stiffness / NOMINAL.stiffness
                    if attribute == "factor"
                    else float(getattr(truth, attribute))
                )
                value = next(iter(effect["parameters"].values()))["value"]
                yield abs(value - true) <= 0.1 * true


def _list_misses(result: ServoResult) -> Iterator[str]:
    """Yield one line for every wrong answer."""
    for case, answer in zip(result.cases, result.answers, strict=True):
        if not is_right(case, answer):
            truth = record_servo(case)
            named = " + ".join(names(answer)) or "nothing named"
            yield (
                f"{case.number:03d} {' + '.join(case.defects) or 'nothing'} at "
                f"{1.0 / truth.period:.0f} Hz ({truth.truth}) -> {named} [{answer['verdict']}]"
            )


def servo_document(result: ServoResult) -> dict[str, Any]:
    """Return the score as a JSON document, with the defects and the answer of every machine."""
    return score_document(result, servo_rows(result), lambda case: {"defects": list(case.defects)})


def servo_table(result: ServoResult) -> str:
    """Return the score as text."""
    lines = score_lines(result.seed, len(result.cases), servo_rows(result))
    return "\n".join([*lines, "", "not answered right:", *_list_misses(result)])
