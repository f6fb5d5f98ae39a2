"""`rigtwin blindcheck`: the check with withheld effects, and whether tuning on a diagnosis pays."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import rigtwin
from rigtwin.cli.options import add_workers, counting_bar
from rigtwin.console import writable, write_json
from rigtwin.errors import RigtwinError

RIGS = 8
"""Of a check of tuning, unless said."""
CASES = 200
SUMMARY = "check the diagnosis on recordings of another rig, whose defects are withheld from it"
MORE = """\
A referee in a process of its own draws rigs and their defects and records tests; the diagnosis sees
the files alone; then the key is opened, checked against its digest, and every answer is scored.

With --wild the machines are others than the rig, and their physics have forms that the library
does not have: friction with a memory or a smooth change of sign, a second mass on a hidden spring,
a frame that yields, drift, drives that sag. What a person would accept as an answer is in the
referee's table.

With --machine arm the machines are planar arms of two and three hinges, and a cart with a
pendulum, all joints moved as measured: single defects, pairs at different joints, none, and some of
forms that the library does not have."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--cases", type=int, help="number of cases (default 200; with --tune 8)")
    parser.add_argument(
        "--tune",
        metavar="STUDY",
        help="instead: is a controller tuned on the diagnosed twin better on the rig itself?",
    )
    parser.add_argument(
        "--wild",
        action="store_true",
        help="instead: other machines, whose physics have forms that the library does not have",
    )
    parser.add_argument(
        "--machine",
        choices=("rig", "arm", "servo"),
        default="rig",
        help="machines with withheld defects (default rig); arm: joints that act on each other; "
        "servo: links on servos known by command and angle alone",
    )
    parser.add_argument(
        "--seed", type=int, default=2026, help="seed of the referee's draws (default 2026)"
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("blindcheck"),
        help="folder of recordings and answers; a second run continues",
    )
    parser.add_argument(
        "--baselines", action="store_true", help="also score what cruder methods would have said"
    )
    parser.add_argument(
        "--json", type=Path, metavar="F.json", help="also write the scores to a file"
    )
    parser.add_argument(
        "--draw",
        type=Path,
        metavar="F.png",
        help="with --wild: also draw the share of right names against their confidence",
    )
    add_workers(parser)


def execute(parsed: argparse.Namespace) -> int:
    """Runs the check that was asked for and prints its score."""
    if (parsed.cases is not None and parsed.cases < 1) or parsed.seed < 0:
        raise RigtwinError("cases: expected 1 or more; seed: 0 or more")
    for out in (parsed.json, parsed.draw):
        if out is not None:
            writable(out)
    if parsed.draw is not None and not parsed.wild:
        raise RigtwinError("--draw: expected with --wild")
    if parsed.wild and (parsed.tune is not None or parsed.baselines):
        raise RigtwinError("--wild: expected without --tune and --baselines")
    if parsed.machine != "rig" and (parsed.wild or parsed.tune is not None or parsed.baselines):
        raise RigtwinError(
            f"--machine {parsed.machine}: expected without --wild, --tune and --baselines"
        )
    if parsed.wild or parsed.machine != "rig":
        return _machines(parsed)
    return _diagnoses(parsed) if parsed.tune is None else _tuning(parsed)


def _diagnoses(parsed: argparse.Namespace) -> int:
    # Here and below imported when asked for: help must not load SciPy and MuJoCo.
    from referee.score import document, table

    with counting_bar("case", "withheld effects") as progress:
        result = rigtwin.blindcheck(
            CASES if parsed.cases is None else parsed.cases,
            seed=parsed.seed,
            folder=parsed.folder,
            baselines=parsed.baselines,
            workers=parsed.workers,
            cluster=parsed.cluster,
            progress=progress,
        )
    print(table(result))
    if parsed.json is not None:
        write_json(parsed.json, document(result))
    return 0


def _machines(parsed: argparse.Namespace) -> int:
    from referee.arm import arm_document, arm_table
    from referee.servo import servo_document, servo_table
    from referee.wild import judge_names, reliability, wild_document, wild_table

    draw = "wild" if parsed.wild else parsed.machine
    table, document = {
        "wild": (wild_table, wild_document),
        "arm": (arm_table, arm_document),
        "servo": (servo_table, servo_document),
    }[draw]
    with counting_bar("machine", "machines") as progress:
        result: Any = rigtwin.blindcheck_machines(
            CASES if parsed.cases is None else parsed.cases,
            draw=draw,
            seed=parsed.seed,
            folder=parsed.folder,
            workers=parsed.workers,
            cluster=parsed.cluster,
            progress=progress,
        )
    print(table(result))
    if parsed.json is not None:
        write_json(parsed.json, document(result))
    if parsed.draw is not None:
        from referee.reliability import draw_reliability

        draw_reliability(reliability(judge_names(result)), parsed.draw)
    return 0


def _tuning(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    from experiments.tuning import find_study
    from referee.tuning import TuningCase, check, document, text
    from rigtwin.studies.sweep import Store, open_workers
    from rigtwin.studies.tuning.bench import Bench

    study = find_study(parsed.tune)
    minimise, budget = study.goals.minimise, study.budget
    if len(minimise) != 1 or minimise[0].more:
        expected = "expected a study with one objective that is of the test itself"
        raise RigtwinError(f"--tune {parsed.tune}: {expected}")
    cases = RIGS if parsed.cases is None else parsed.cases
    # One search for each rig, and one on the nominal twin for comparison.
    searches = (cases + 1) * (budget.evaluations + 1) * budget.roads
    total = searches + cases * (1 + 3 * budget.held_out)
    with (
        open_workers(parsed.workers, parsed.cluster) as workers,
        Store(parsed.folder / f"tuning-{study.name}.sqlite") as store,
        tqdm(total=total, disable=None, unit="run", leave=False, file=sys.stderr) as bar,
    ):

        def show(case: TuningCase) -> None:
            outcome = f"withheld {case.defect}; diagnosed: {case.sentence}"
            bar.write(f"rig {case.number + 1}: {outcome}", file=sys.stdout)

        bench = Bench(study, store, workers, bar.update)
        cases_tuned = check(bench, cases, parsed.seed, stage=bar.set_description, show=show)
    print(text(study, cases_tuned))
    if parsed.json is not None:
        write_json(parsed.json, document(study, cases_tuned))
    return 0
