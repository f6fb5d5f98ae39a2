"""Checks on machines whose defects are withheld from the diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from referee.score import names
from referee.score_row import ScoreRow
from referee.wild_recordings import WildData
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, Workers, run_jobs

Case = TypeVar("Case")
Question = tuple[str, list[WildData]]
"""Machine by name, and its data: a test and a held-out one."""


@dataclass(frozen=True)
class Withheld(Generic[Case]):
    """Result of a check.

    Attributes
    ----------
    seed : int
        Seed of the cases.
    cases : tuple
        Withheld cases.
    answers : tuple of dict
        The diagnoses' answers, one JSON document per case.
    """

    seed: int
    cases: tuple[Case, ...]
    answers: tuple[dict[str, Any], ...]


def check_machines(
    store: Path,
    cases: Sequence[Case],
    seed: int,
    ask: Callable[[Case], Question],
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> Withheld[Case]:
    """Run a whole check.

    Parameters
    ----------
    store : Path
        File of the stored answers. An interrupted check resumes from it.
    cases : sequence
        Withheld cases.
    seed : int
        Seed of the cases.
    ask : callable
        Function that returns the data of a case, which the diagnosis sees.
    workers : Workers
        Processes that diagnose. They get recordings and a description, and draw nothing.
    progress : callable
        Function called with 1 after every answer.

    Returns
    -------
    Withheld
        Cases and answers.
    """
    store.parent.mkdir(parents=True, exist_ok=True)
    keys = [f"{seed}-{number}" for number in range(len(cases))]

    def jobs() -> Iterator[tuple[str, Question]]:
        for key, case in zip(keys, cases, strict=True):
            yield key, ask(case)

    with Store(store) as answers:
        run_jobs(answers, workers, answer_question, jobs(), progress)
        return Withheld(seed, tuple(cases), tuple(answers[key] for key in keys))


def answer_question(question: Question) -> dict[str, Any]:
    """Return the answer to one case, from a recording and a held-out one.

    Refused data count as an answer with the verdict `unusable`.
    """
    from rigtwin.description.catalogue import find
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.recording import RecordedTest

    name, tests = question
    machine = find(name)

    def load(data: WildData, label: str) -> RecordedTest:
        ticks = len(next(iter(next(iter(data.columns.values())).values())))
        times = np.arange(ticks) * data.period
        return RecordedTest(Path(label), machine.name, "", data.period, times, data.columns, {})

    start = time.perf_counter()
    fitted, held_out = (load(data, label) for data, label in zip(tests, "ab", strict=True))
    try:
        return diagnose(machine, [fitted], held_out=[held_out]).document()
    except RigtwinError as error:
        seconds = time.perf_counter() - start
        return {"verdict": "unusable", "effects": [], "sentence": str(error), "seconds": seconds}


def score_document(
    result: Withheld[Case], rows: Sequence[ScoreRow], describe: Callable[[Case], dict[str, Any]]
) -> dict[str, Any]:
    """Return a score as a JSON document, with the answer to every case.

    Parameters
    ----------
    result : Withheld
        Cases and answers.
    rows : sequence of ScoreRow
        Measures of the score.
    describe : callable
        Function that returns what the document says of a case.
    """
    return {
        "seed": result.seed,
        "cases": len(result.cases),
        "rows": [asdict(row) for row in rows],
        "machines": [
            {
                **describe(case),
                "named": names(answer),
                "verdict": answer["verdict"],
                "effects": answer["effects"],
            }
            for case, answer in zip(result.cases, result.answers, strict=True)
        ],
    }


def seconds_row(answers: Sequence[dict[str, Any]]) -> ScoreRow:
    """Return the row of the computing time."""
    seconds = [answer["seconds"] for answer in answers]
    return ScoreRow(
        "seconds a case, median / largest", f"{np.median(seconds):.1f} / {max(seconds):.1f}", ""
    )


def score_lines(seed: int, machines: int, rows: Sequence[ScoreRow]) -> list[str]:
    """Return a score as text: a heading, and a line for each measure."""
    lines = [f"seed {seed}, {machines} machines", ""]
    for row in rows:
        interval = ""
        if row.low is not None and row.high is not None:
            interval = f"[{100 * row.low:.0f} to {100 * row.high:.0f} %]"
        lines.append(f"{row.measure:44s} {row.value:24s} {interval:16s} {row.goal}".rstrip())
    return lines
