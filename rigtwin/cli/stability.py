"""`rigtwin stability`: which vehicles a rig with these lags can carry."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.console import table, writable, write_json
from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.vehicle import QuarterCar, believable, checked_time

RIG_LAG = 0.01
"""s, of the four filters (thesis §6.2)."""
ROUNDING = 1e-12
"""Of a pole's distance from the origin: a real part within this is none."""
TABLE_6_2 = "quarter-car"
SUMMARY = "say whether a vehicle is stable on the rig with its delays, and how much delay it bears"
MORE = "example:\n  rigtwin stability --vehicle car --tau 0.01"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vehicle",
        default=TABLE_6_2,
        metavar="NAME",
        help=f"by name (default {TABLE_6_2}: thesis Table 6.2)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="another value of it, e.g. suspension_damping=500",
    )
    parser.add_argument(
        "--tau", type=float, default=RIG_LAG, metavar="S", help="lag of every path (default 0.01)"
    )
    parser.add_argument(
        "--delay",
        action="store_true",
        help="the rightmost pole with pure delays of tau instead of lags",
    )
    parser.add_argument(
        "--map",
        nargs=2,
        metavar=("X", "Y"),
        help="draw stability over two parameters, e.g. sprung_mass tau",
    )
    parser.add_argument(
        "--model",
        default="rig",
        metavar="NAME",
        help="of the map: one of those in the table (default rig)",
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
    from rigtwin.studies.stability.mapping import (
        around,
        checked_ending,
        checked_model,
        draw,
        stability_map,
    )

    car = _changed(_vehicle(parsed.vehicle), parsed.set)
    tau = checked_time("--tau", parsed.tau)
    out = parsed.out or Path("stability.png")
    if parsed.out is not None and parsed.map is None:
        raise RigtwinError(f"-o {parsed.out}: expected --map X Y, the parameters to draw it over")
    for path in filter(None, (out if parsed.map else None, parsed.json)):
        writable(path)
    if parsed.map:
        checked_ending(out)
        checked_model(parsed.model)
        if parsed.delay:
            raise RigtwinError("--delay with --map: a map is of lags; leave one of them out")
        if parsed.map[0] == parsed.map[1]:
            raise RigtwinError(
                f"--map {parsed.map[0]} {parsed.map[1]}: expected two different parameters"
            )
    axes = [around(name, car, tau) for name in parsed.map or ()]
    rows = _rows(car, tau, parsed.delay)
    print(", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in car._asdict().items()))
    print(_printed(rows, tau, parsed.delay))
    at_rig = _rows(car, RIG_LAG, delay=False)["rig"]
    words = "stable" if at_rig["stable"] else "unstable"
    print(
        f"the rig of thesis §6.2, four lags of {1e3 * RIG_LAG:g} "
        f"ms: rightmost pole {_pole(at_rig)} 1/s, {words}"
    )
    if parsed.map:
        draw(stability_map(parsed.model, car, tau, axes[0], axes[1]), out)
        print(f"drawn in {out}")
    if parsed.json is not None:
        write_json(
            parsed.json,
            {"vehicle": car._asdict(), "tau": tau, "models": rows, "rig_at_10_ms": at_rig},
        )
    return 0


def _vehicle(name: str) -> QuarterCar:
    from controllers.settings import Settings
    from experiments.vehicles import VEHICLES
    from rigtwin.components import Carriage, Tyre

    tyre, settings = Tyre(), Settings()
    found = {
        TABLE_6_2: QuarterCar(
            tyre.stiffness,
            tyre.damping,
            Carriage().mass,
            settings.suspension_stiffness,
            settings.suspension_damping,
            settings.sprung_mass,
        )
    }
    for each, vehicle in VEHICLES.items():
        found[each] = QuarterCar(tyre_damping=0.0, **vehicle._asdict())
    if name not in found:
        raise RigtwinError(f"unknown vehicle {name!r}; there are {', '.join(found)}")
    return found[name]


def _changed(car: QuarterCar, assignments: list[str]) -> QuarterCar:
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        if name not in QuarterCar._fields:
            raise RigtwinError(
                f"--set {assignment}: unknown parameter {name!r}; "
                f"there are {', '.join(QuarterCar._fields)}"
            )
        try:
            car = car._replace(**{name: float(text)})
        except ValueError:
            raise RigtwinError(f"--set {assignment}: expected a number after {name}=") from None
    return believable(car)


def _rows(car: QuarterCar, tau: float, delay: bool) -> dict[str, dict[str, float | bool | None]]:
    """Model → its figures, SI units."""
    from rigtwin.studies.stability.critical import critical_delay, critical_lag
    from rigtwin.studies.stability.delayed import rightmost_delay_root
    from rigtwin.studies.stability.loop import LOOPS
    from rigtwin.studies.stability.models import MODELS, rightmost

    found: dict[str, dict[str, float | bool | None]] = {}
    for name, model in MODELS.items():
        loop = LOOPS[name](car)
        pole = rightmost_delay_root(loop, tau) if delay else rightmost(model(car, tau))
        lag, pure = critical_lag(loop), critical_delay(loop)
        found[name] = {
            "real": pole.real,
            "imaginary": abs(pole.imag),
            "stable": pole.real < -ROUNDING * abs(pole),
            "critical_lag": lag.time if lag else None,
            "critical_lag_frequency": lag.frequency if lag else None,
            "critical_delay": pure.time if pure else None,
            "critical_delay_frequency": pure.frequency if pure else None,
        }
    return found


def _printed(rows: dict[str, dict[str, float | bool | None]], tau: float, delay: bool) -> str:
    kind = "delays" if delay else "lags"
    lines: list[tuple[str, ...]] = [
        (
            "model",
            f"rightmost pole, {kind} of {1e3 * tau:g} ms",
            "stable",
            "critical lag",
            "at",
            "critical delay",
            "at",
        )
    ]
    for name, row in rows.items():
        times = []
        for key in ("critical_lag", "critical_delay"):
            time, frequency = row[key], row[f"{key}_frequency"]
            times += (
                ["none", ""] if time is None else [f"{1e3 * time:.4g} ms", f"{frequency:.4g} rad/s"]
            )
        lines.append((name, f"{_pole(row)} 1/s", "yes" if row["stable"] else "no", *times))
    return table(lines)


def _pole(row: dict[str, float | bool | None]) -> str:
    return f"{row['real']:+.4g} ± {row['imaginary']:.4g}j"
