"""`rigtwin stability`: which vehicles a rig with these lags can carry."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import rigtwin
from rigtwin.console import table, writable, write_json
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin import ModelStability, Stability

RIG_LAG = 0.01
"""s, of the four filters (thesis §6.2)."""
TABLE_6_2 = "quarter-car"
COMPENSATOR = "kalman-inverse"
DRAWN = "rig"
"""Model whose map is drawn, unless another is named."""
SUMMARY = "say whether a vehicle is stable on the rig with its delays, and how much delay it bears"
MORE = "example:\n  rigtwin stability --vehicle car --tau 0.01"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vehicle",
        default=TABLE_6_2,
        metavar="NAME",
        help=f"name of the vehicle (default {TABLE_6_2}: thesis Table 6.2)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a parameter of the vehicle, e.g. suspension_damping=500",
    )
    parser.add_argument(
        "--tau", type=float, default=RIG_LAG, metavar="S", help="lag of every path (default 0.01)"
    )
    parser.add_argument(
        "--delay",
        action="store_true",
        help="give the rightmost pole for pure delays of tau instead of lags",
    )
    parser.add_argument(
        "--compensator",
        default=COMPENSATOR,
        metavar="NAME",
        help=f"compensator of the plate's delay on the sampled rig (default {COMPENSATOR})",
    )
    parser.add_argument(
        "--map",
        nargs=2,
        metavar=("X", "Y"),
        help="draw stability over two parameters, e.g. sprung_mass tau",
    )
    parser.add_argument(
        "--model", metavar="NAME", help=f"model of the map, one of the table's (default {DRAWN})"
    )
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.png",
        help="where to draw the map (default stability.png)",
    )
    parser.add_argument(
        "--json", type=Path, metavar="F.json", help="also write the figures to a file"
    )


def execute(parsed: argparse.Namespace) -> int:
    """Prints the poles and the critical lag and delay of every model of a vehicle."""
    from rigtwin.studies.stability.mapping import POINTS, SPARSE, around, draw, stability_map
    from rigtwin.studies.stability.tested import AS_RUN

    stability = rigtwin.stability(
        parsed.vehicle, changes=_numbers(parsed.set), tau=parsed.tau, delay=parsed.delay
    )
    car, tau = stability.vehicle, stability.tau
    out, model = parsed.out or Path("stability.png"), parsed.model or DRAWN
    _check_outputs(parsed, out, model)
    margin = rigtwin.rig_margin(car, compensator=parsed.compensator)
    points = SPARSE if model in AS_RUN else POINTS
    # Axes are built before anything is printed, as they may refuse a name.
    axes = [around(name, car, tau, points) for name in parsed.map or ()]
    print(", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in car._asdict().items()))
    print(_printed(stability))
    # The published rig is shown beside whatever lag was asked for.
    at_rig = rigtwin.stability(car, tau=RIG_LAG).models["rig"]
    words = "stable" if at_rig.stable else "unstable"
    print(
        f"the rig of thesis §6.2, four lags of {1e3 * RIG_LAG:g} "
        f"ms: rightmost pole {_pole(at_rig)} 1/s, {words}"
    )
    print(f"the rig as it runs: {_margin(margin)}")
    if parsed.map:
        draw(stability_map(model, car, tau, axes[0], axes[1]), out)
        print(f"drawn in {out}")
    if parsed.json is not None:
        write_json(
            parsed.json,
            {
                "vehicle": car._asdict(),
                "tau": tau,
                "models": {name: asdict(each) for name, each in stability.models.items()},
                "rig_at_10_ms": asdict(at_rig),
                "as_run": asdict(margin),
            },
        )
    return 0


def _check_outputs(parsed: argparse.Namespace, out: Path, model: str) -> None:
    """Raise RigtwinError for a map that cannot be drawn, or options that require one."""
    from rigtwin.studies.stability.mapping import check_image_format, check_model

    if parsed.out is not None and parsed.map is None:
        raise RigtwinError(f"-o {parsed.out}: expected --map X Y, the parameters to draw it over")
    if parsed.model is not None and parsed.map is None:
        raise RigtwinError(f"--model {parsed.model}: expected --map X Y, which it is drawn over")
    for path in filter(None, (out if parsed.map else None, parsed.json)):
        writable(path)
    if parsed.map:
        check_image_format(out)
        check_model(model)
        if parsed.delay:
            raise RigtwinError("--delay with --map: a map is of lags; leave one of them out")
        if parsed.map[0] == parsed.map[1]:
            raise RigtwinError(
                f"--map {parsed.map[0]} {parsed.map[1]}: expected two different parameters"
            )


def _numbers(assignments: list[str]) -> dict[str, float]:
    numbers = {}
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        try:
            numbers[name] = float(text)
        except ValueError:
            raise RigtwinError(f"--set {assignment}: expected a number after {name}=") from None
    return numbers


def _printed(stability: Stability) -> str:
    kind = "delays" if stability.delay else "lags"
    lines: list[tuple[str, ...]] = [
        (
            "model",
            f"rightmost pole, {kind} of {1e3 * stability.tau:g} ms",
            "stable",
            "critical lag",
            "at",
            "critical delay",
            "at",
        )
    ]
    for name, model in stability.models.items():
        times = [
            *_time(model.critical_lag, model.critical_lag_frequency),
            *_time(model.critical_delay, model.critical_delay_frequency),
        ]
        lines.append((name, f"{_pole(model)} 1/s", "yes" if model.stable else "no", *times))
    return table(lines)


def _margin(margin: rigtwin.RigMargin) -> str:
    text = f"slowest motion {-margin.plain:+.2g} 1/s plain, "
    text += f"{-margin.compensated:+.2g} 1/s with the plate's delay compensated"
    if margin.delay_margin is None:
        return f"{text}, unstable with that too"
    return f"{text}, stable with {1e3 * margin.delay_margin:.2g} ms more delay than it is told of"


def _time(time: float | None, frequency: float | None) -> tuple[str, str]:
    return ("none", "") if time is None else (f"{1e3 * time:.4g} ms", f"{frequency:.4g} rad/s")


def _pole(model: ModelStability) -> str:
    return f"{model.real:+.4g} ± {model.imaginary:.4g}j"
