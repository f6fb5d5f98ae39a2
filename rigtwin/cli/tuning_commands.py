"""`rigtwin tune`: a study from its file to its folder."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from tqdm import tqdm

from experiments.tuning import STUDIES, find_study
from rigtwin.console import table
from rigtwin.description.posterior import Posterior, load_posterior
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, open_workers
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.folder import PAGE, RUNS, SETTINGS, write
from rigtwin.studies.tuning.result import tune as tune_study
from rigtwin.studies.tuning.study import Study
from rigtwin.studies.tuning.text import concerns, text


def tune(parsed: Namespace) -> int:
    """Tune, evaluate, and write the folder; a second run goes on where the first was stopped.

    Returns
    -------
    int
        4 if something speaks against the settings that were found, else 0.
    """
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
    rows = [("study", "what", "experiment", "parameters")]
    for name in STUDIES:
        study = find_study(name)
        parameters = ", ".join(parameter.name for parameter in study.parameters)
        rows.append((name, study.title, study.experiment.name, parameters))
    return table(rows)
