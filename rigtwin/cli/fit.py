"""`rigtwin fit`: the values of effects that are already suspected."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.cli.options import (
    add_columns,
    add_held_out,
    add_json,
    add_machine,
    add_settings,
    read_recordings,
    settings_of,
)
from rigtwin.console import table, writable, write_json

if TYPE_CHECKING:
    from rigtwin import EffectFit

SUMMARY = "fit the values of effects that are already suspected"
MORE = """\
Searches for nothing: it returns the values that explain the recordings best if these effects and no
others act, with 95 % intervals, what is confounded, and the errors on held-out recordings.

examples:
  rigtwin fit arm.mcap -e coulomb@elbow -e viscous@elbow
  rigtwin fit log.csv -e delay@servo_1 --machine arm.xml --held-out other.csv
  rigtwin effects --machine arm.toml            which effects there are"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recordings", type=Path, nargs="+", metavar="recording")
    parser.add_argument(
        "-e",
        "--effect",
        action="append",
        default=[],
        required=True,
        metavar="EFFECT",
        help="effect to fit, such as coulomb@elbow; once for each",
    )
    add_held_out(parser)
    parser.add_argument(
        "--save-mjcf",
        type=Path,
        metavar="F.xml",
        help="write the machine's own MJCF with the fitted values, nothing else changed",
    )
    add_json(parser, "the values for other programs")
    add_machine(parser)
    add_columns(parser)
    add_settings(parser)


def execute(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    import rigtwin

    # Before the fit, which takes longer than a mistake is worth.
    for out in (parsed.json, parsed.save_mjcf):
        if out is not None:
            writable(out)
    recordings, held_out = read_recordings(parsed)
    with tqdm(disable=None, unit=" fits", desc="fitting", leave=False) as bar:
        fitted = rigtwin.fit(
            recordings,
            parsed.effect,
            held_out=held_out,
            settings=settings_of(parsed),
            progress=bar.update,
        )
    print(_describe(fitted))
    if parsed.save_mjcf is not None:
        for line in fitted.save_mjcf(parsed.save_mjcf):
            print(f"not in the MJCF: {line}")
    if parsed.json is not None:
        write_json(parsed.json, _document(fitted))
    return 0


def _describe(fitted: EffectFit) -> str:
    rows: list[tuple[str, ...]] = [("parameter", "value", "95 % interval", "nominal", "unit")]
    rows += [
        (p.name, f"{p.value:.4g}", f"{p.low:.4g} to {p.high:.4g}", f"{p.nominal:.4g}", p.unit)
        for p in fitted.parameters
    ]
    lines = [table(rows), "", "residual, as a share of the signals' swing:"]
    for title, before, after in (
        ("fitted", fitted.error_before, fitted.error_after),
        ("held out", fitted.held_out_before, fitted.held_out_after),
    ):
        lines += [
            f"  {title}: {100 * a:.3g} % before, {100 * b:.3g} % after"
            for a, b in zip(before, after, strict=True)
        ]
    return "\n".join([*lines, *(f"warning: {line}" for line in fitted.warnings)])


def _document(fitted: EffectFit) -> dict[str, object]:
    return {
        "parameters": [asdict(parameter) for parameter in fitted.parameters],
        "covariance": fitted.covariance.tolist(),
        "error_before": fitted.error_before,
        "error_after": fitted.error_after,
        "held_out_before": fitted.held_out_before,
        "held_out_after": fitted.held_out_after,
        "warnings": fitted.warnings,
    }
