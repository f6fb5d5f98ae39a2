"""`rigtwin tune`: a study from its file to its folder."""

from __future__ import annotations

import argparse
from pathlib import Path

import rigtwin
from rigtwin.cli.options import add_workers, counting_bar
from rigtwin.console import table

SUMMARY = "tune the controller on the twin, and judge it on roads that the tuning has not seen"
MORE = """\
A study is a TOML file: parameters with bounds, objectives, constraints, and what varies;
docs/tuning.md. Without one, those that come along are listed.

examples:
  rigtwin tune skyhook --out tuning/skyhook
  rigtwin tune friction --twin calibrated.toml     of a rig that diagnose --save-twin has described
  rigtwin tune study.toml --machine arm.toml       of any machine with a [controller]
  rigtwin run active --config tuning/skyhook/tuned.toml

Every run is kept; a second call goes on where the first was stopped."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", nargs="?", help="a study by name, or the path of its file")
    parser.add_argument(
        "--machine",
        metavar="F.toml",
        help="machine whose controller is tuned, by name or description (default: the study's)",
    )
    parser.add_argument(
        "--twin",
        type=Path,
        metavar="F.toml",
        help="tune on this calibrated twin and within its uncertainty",
    )
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="FOLDER",
        help="folder of the results (default tuning/STUDY)",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        help="seed of the optimiser (default 1); the same seed gives the same settings",
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
    add_workers(parser)


def execute(parsed: argparse.Namespace) -> int:
    """Tune, evaluate, and write the folder; a second run goes on where the first was stopped.

    Returns
    -------
    int
        4 if something speaks against the settings that were found, else 0.
    """
    from rigtwin.studies.tuning.folder import PAGE, SETTINGS, default_folder
    from rigtwin.studies.tuning.text import command, concerns, text

    if parsed.study is None:
        print(_list_studies())
        return 0
    with counting_bar("run", "tune") as progress:
        result = rigtwin.tune(
            parsed.study,
            machine=parsed.machine,
            settings=parsed.set,
            twin=parsed.twin,
            out=parsed.out,
            seed=parsed.seed,
            evaluations=parsed.evaluations,
            roads=parsed.roads,
            held_out=parsed.held_out,
            workers=parsed.workers,
            cluster=parsed.cluster,
            progress=progress,
        )
    # The same rule as in the call, which does not return the folder.
    folder = parsed.out or default_folder(result.study)
    print(text(result))
    print(f"\nlook at {folder / PAGE}\n{command(result.study, folder / SETTINGS)}")
    return 4 if concerns(result) else 0


def _list_studies() -> str:
    from experiments.tuning import STUDIES, find_study

    rows = [("study", "what", "experiment", "parameters")]
    for name in STUDIES:
        study = find_study(name)
        parameters = ", ".join(parameter.name for parameter in study.parameters)
        rows.append((name, study.title, study.experiment.name, parameters))
    return table(rows)
