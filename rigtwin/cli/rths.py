"""`rigtwin rths`: the benchmark of real-time hybrid simulation."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import rigtwin
from rigtwin.console import table, writable, write_json
from rigtwin.errors import RigtwinError

SUMMARY = "run the benchmark of real-time hybrid simulation: a building whose first column is real"
MORE = """\
examples:
  rigtwin rths --case 1 --quake elcentro --compensator sample
  rigtwin rths --case 4 --plants 20                the compensator that follows best
  rigtwin rths --case 4 --compensator adaptive-model --tune
  rigtwin reproduce rths                           all of them, beside what is published

With --tune the compensator's gains, rates or weights are looked for on --plants actuators
(default 8) and judged on as many others."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--case", type=int, default=1, help="case of the building, 1 to 4 (default 1)"
    )
    parser.add_argument(
        "--quake", default="elcentro", help="elcentro, kobe or morgan (default elcentro)"
    )
    parser.add_argument(
        "--compensator",
        default="kalman-inverse",
        metavar="NAME",
        help="name of the compensator (default kalman-inverse)",
    )
    parser.add_argument(
        "--plants",
        type=int,
        help="actuators to try: the nominal one, then drawn ones (default 1, with --tune 8)",
    )
    parser.add_argument(
        "--noise", action="store_true", help="add the noise of the benchmark's converters"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of plants and noise (default 1)")
    parser.add_argument("--tune", action="store_true", help="tune the compensator first")
    parser.add_argument(
        "--evaluations",
        type=int,
        default=30,
        help="evaluations of the criterion, with --tune (default 30)",
    )
    parser.add_argument(
        "--json", type=Path, metavar="F.json", help="also write the figures to a file"
    )


def execute(parsed: argparse.Namespace) -> int:
    """Prints the criteria and the largest force, motion and speed of every plant."""
    from experiments.rths.noise import BENCHMARK, NONE

    if parsed.json is not None:
        writable(parsed.json)
    if parsed.tune:
        return _tune(parsed)
    tests = rigtwin.rths(
        parsed.case,
        quake=parsed.quake,
        compensator=parsed.compensator,
        plants=1 if parsed.plants is None else parsed.plants,
        noise=BENCHMARK if parsed.noise else NONE,
        seed=parsed.seed,
    )
    rows: list[tuple[str, ...]] = [
        ("plant", "J1 ms", *(f"J{number} %" for number in range(2, 10)), "N", "mm", "mm/s", "")
    ]
    for number, test in enumerate(tests):
        if not test.stable:
            # A test that diverged has no figures worth printing.
            rows.append((_named(number), *[""] * 12, "unstable"))
            continue
        figures = [
            *(f"{value:.2f}" for value in test.criteria),
            f"{test.force:.0f}",
            f"{1e3 * test.motion:.2f}",
            f"{1e3 * test.speed:.0f}",
        ]
        rows.append((_named(number), *figures, "" if test.within else "beyond a limit"))
    print(table(rows))
    if parsed.json is not None:
        write_json(parsed.json, {"case": parsed.case, "quake": parsed.quake, "plants": _all(tests)})
    return 0


def _tune(parsed: argparse.Namespace) -> int:
    """Prints the knobs and the figures before and after."""
    from tqdm import tqdm

    if parsed.noise:
        raise RigtwinError("--noise: a tuning looks at both, with noise and without")
    plants = 8 if parsed.plants is None else parsed.plants
    shown = {"unit": "evaluation", "desc": f"tuning {parsed.compensator}", "leave": False}
    with tqdm(total=parsed.evaluations + 1, disable=None, **shown) as bar:
        tuned = rigtwin.tune_compensator(
            parsed.compensator,
            parsed.case,
            quake=parsed.quake,
            plants=plants,
            held_out_plants=plants,
            evaluations=parsed.evaluations,
            seed=parsed.seed,
            progress=bar.update,
        )
    rows: list[tuple[str, ...]] = [("", "before", "after")]
    rows += [(k, f"{v:.4g}", f"{tuned.after[k]:.4g}") for k, v in tuned.before.items()]
    for label, pair in (
        ("criterion, on the plants it was tuned on, %", tuned.criterion),
        ("J2 without noise, worst of the others, %", tuned.judged),
        ("J2 with noise above its floor, points", tuned.noisy),
    ):
        rows.append((label, *(f"{value:.3f}" for value in pair)))
    print(table(rows))
    if parsed.json is not None:
        write_json(parsed.json, asdict(tuned))
    return 0


def _named(number: int) -> str:
    return str(number) if number else "nominal"


def _all(tests: list[rigtwin.HybridTest]) -> list[dict[str, object]]:
    return [
        {
            "criteria": test.criteria._asdict() if test.stable else None,
            "force": test.force,
            "motion": test.motion,
            "speed": test.speed,
            "stable": test.stable,
            "within": test.within,
        }
        for test in tests
    ]
