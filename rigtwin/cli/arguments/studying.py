"""The commands that work through many runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.arguments.shared import Command, workers
from rigtwin.cli.stability_commands import arguments as stability_arguments


def add(command: Command) -> None:
    reproduce = command(
        "reproduce",
        "reproduce the thesis: its tables, figures and statements beside ours",
        "examples:\n"
        "  rigtwin reproduce                       everything, under ten minutes on two cores\n"
        "  rigtwin reproduce 5                     a chapter\n"
        "  rigtwin reproduce table-4.2             a table, figure or equation\n"
        "  rigtwin reproduce skyhook --html F.html --draw FOLDER\n\n"
        "Results of finished jobs are kept; a second run goes on where the first was stopped.",
    )
    reproduce.add_argument(
        "what",
        nargs="*",
        help="a chapter (3 to 7, A), study, table, figure or equation; default: everything",
    )
    reproduce.add_argument(
        "--seeds", type=int, default=32, help="roads and noise to judge over (default 32)"
    )
    workers(reproduce)
    reproduce.add_argument(
        "--folder",
        type=Path,
        default=Path("reproduction"),
        help="of the results (default reproduction)",
    )
    reproduce.add_argument(
        "--json", type=Path, metavar="F.json", help="also write everything for other programs"
    )
    reproduce.add_argument(
        "--html", type=Path, metavar="F.html", help="also write a page to look at, one file"
    )
    reproduce.add_argument(
        "--draw",
        type=Path,
        metavar="FOLDER",
        help="where to draw the figures (default: figures in --folder)",
    )
    reproduce.add_argument(
        "--gallery", type=Path, metavar="FOLDER", help="also write gallery.md with its pictures"
    )

    tune(
        command(
            "tune",
            "tune the controller on the twin, and judge it on roads that the tuning has not seen",
            TUNE,
        )
    )

    stability = command(
        "stability",
        "say whether a vehicle is stable on the rig with its delays, and how much delay it bears",
        "example:\n  rigtwin stability --vehicle car --tau 0.01",
    )
    stability_arguments(stability)


TUNE = """\
A study is a TOML file: parameters with bounds, objectives, constraints, and what varies; docs/tuning.md. Without one, those
that come along are listed.

examples:
  rigtwin tune skyhook --out tuning/skyhook
  rigtwin tune friction --twin calibrated.toml     of a rig that diagnose --save-twin has described
  rigtwin run active --config tuning/skyhook/tuned.toml

Every run is kept; a second call goes on where the first was stopped."""


def tune(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", nargs="?", help="a study by name, or the path of its file")
    parser.add_argument(
        "--twin",
        type=Path,
        metavar="F.toml",
        help="tune on this calibrated twin and within its uncertainty",
    )
    parser.add_argument(
        "--out", "-o", type=Path, metavar="FOLDER", help="of the results (default tuning/STUDY)"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        help="of the optimiser (default 1); the same seed gives the same settings",
    )
    parser.add_argument(
        "--evaluations",
        type=int,
        metavar="N",
        help="about how many candidates (default: the study's)",
    )
    parser.add_argument(
        "--roads",
        type=int,
        metavar="N",
        help="scenarios that each is tried in (default: the study's)",
    )
    parser.add_argument(
        "--held-out", type=int, metavar="N", help="scenarios to judge on (default: the study's)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a setting of every run",
    )
    workers(parser)
