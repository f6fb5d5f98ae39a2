"""`rigtwin tune`: a study from its file to its folder."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.cli.options import add_workers
from rigtwin.console import table
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin.description.posterior import Posterior
    from rigtwin.studies.tuning.study import Study

SUMMARY = "tune the controller on the twin, and judge it on roads that the tuning has not seen"
MORE = """\
A study is a TOML file: parameters with bounds, objectives, constraints, and what varies;
docs/tuning.md. Without one, those that come along are listed.

examples:
  rigtwin tune skyhook --out tuning/skyhook
  rigtwin tune friction --twin calibrated.toml     of a rig that diagnose --save-twin has described
  rigtwin run active --config tuning/skyhook/tuned.toml

Every run is kept; a second call goes on where the first was stopped."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
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
    add_workers(parser)


def execute(parsed: argparse.Namespace) -> int:
    """Tune, evaluate, and write the folder; a second run goes on where the first was stopped.

    Returns
    -------
    int
        4 if something speaks against the settings that were found, else 0.
    """
    from tqdm import tqdm

    from experiments.tuning import find_study
    from rigtwin.description.posterior import load_posterior
    from rigtwin.studies.sweep import Store, open_workers
    from rigtwin.studies.tuning.bench import Bench
    from rigtwin.studies.tuning.folder import PAGE, RUNS, SETTINGS, write
    from rigtwin.studies.tuning.result import tune as tune_study
    from rigtwin.studies.tuning.text import concerns, text

    if parsed.study is None:
        print(_list_studies())
        return 0
    if parsed.seed < 0:
        raise RigtwinError(f"--seed {parsed.seed}: expected 0 or more")
    study = find_study(
        parsed.study,
        parsed.set,
        roads=parsed.roads,
        held_out=parsed.held_out,
        evaluations=parsed.evaluations,
    )
    posterior = None if parsed.twin is None else load_posterior(parsed.twin)
    folder = parsed.out or Path("tuning") / study.name
    if folder.exists() and not folder.is_dir():
        raise RigtwinError(f"cannot write into {folder}: it is a file")
    total = _count_runs(study, posterior)
    with (
        open_workers(parsed.workers, parsed.cluster) as workers,
        Store(folder / RUNS) as store,
        tqdm(total=total, disable=None, unit="run", leave=False, file=sys.stderr) as bar,
    ):
        bench = Bench(study, store, workers, bar.update)
        result = tune_study(bench, parsed.seed, posterior, bar.set_description)
    twin = study.configuration if posterior is None else posterior.at_best(study.configuration)
    write(folder, result, twin)
    print(text(result))
    run = f"rigtwin run {study.experiment.name} --config {folder / SETTINGS}"
    print(f"\nlook at {folder / PAGE}\n{run}")
    return 4 if concerns(result) else 0


def _count_runs(study: Study, posterior: Posterior | None) -> int:
    """About how many there will be."""
    budget = study.budget
    searches = 1 if posterior is None else 2
    rigs = 1 + len(study.other_rigs) + (0 if posterior is None else 1 + len(posterior.otherwise))
    points = budget.points if len(study.goals.minimise) == 2 else 0
    tried = searches * (budget.evaluations + 1) * budget.roads
    return tried + budget.held_out * (rigs * (1 + searches) + points)


def _list_studies() -> str:
    from experiments.tuning import STUDIES, find_study

    rows = [("study", "what", "experiment", "parameters")]
    for name in STUDIES:
        study = find_study(name)
        parameters = ", ".join(parameter.name for parameter in study.parameters)
        rows.append((name, study.title, study.experiment.name, parameters))
    return table(rows)
