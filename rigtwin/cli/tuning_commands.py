"""`rigtwin tune`: a study from its file to its folder."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from tqdm import tqdm

from rigtwin.console import table
from rigtwin.errors import RigtwinError
from rigtwin.machine.posterior import Posterior, load_posterior
from rigtwin.studies.sweep import Store, open_workers
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.folder import PAGE, RUNS, SETTINGS, write
from rigtwin.studies.tuning.outcome import tuned
from rigtwin.studies.tuning.reading import find
from rigtwin.studies.tuning.study import Study, shipped
from rigtwin.studies.tuning.text import concerns, text


def tune(parsed: Namespace) -> int:
    """Tunes, judges, and writes the folder; a second run goes on where the first was stopped. Returns 4 if something speaks
    against the settings that were found."""
    if parsed.study is None:
        print(_listing())
        return 0
    if parsed.seed < 0:
        raise RigtwinError(f"--seed {parsed.seed}: expected 0 or more")
    numbers = {"roads": parsed.roads, "held_out": parsed.held_out, "evaluations": parsed.evaluations}
    study = find(parsed.study, parsed.set, **numbers)
    posterior = None if parsed.twin is None else load_posterior(parsed.twin)
    folder = parsed.out or Path("tuning") / study.name
    if folder.exists() and not folder.is_dir():
        raise RigtwinError(f"cannot write into {folder}: it is a file")
    with (
        open_workers(parsed.workers, parsed.cluster) as workers,
        Store(folder / RUNS) as store,
        tqdm(total=_runs(study, posterior), disable=None, unit="run", leave=False, file=sys.stderr) as bar,
    ):
        bench = Bench(study, store, workers, bar.update)
        outcome = tuned(bench, parsed.seed, posterior, bar.set_description)
    twin = study.configuration if posterior is None else posterior.at_best(study.configuration)
    write(folder, outcome, twin)
    print(text(outcome))
    print(f"\nlook at {folder / PAGE}\nrigtwin run {study.experiment} --config {folder / SETTINGS}")
    return 4 if concerns(outcome) else 0


def _runs(study: Study, posterior: Posterior | None) -> int:
    """About how many there will be."""
    searches = 1 if posterior is None else 2
    rigs = 1 + len(study.judge) + (0 if posterior is None else 1 + len(posterior.otherwise))
    points = study.points if len(study.minimise) == 2 else 0
    return searches * (study.evaluations + 1) * study.roads + study.held_out * (rigs * (1 + searches) + points)


def _listing() -> str:
    rows = [("study", "what", "experiment", "parameters")]
    for name in shipped():
        study = find(name)
        rows.append((name, study.title, study.experiment, ", ".join(each.key.partition(".")[2] for each in study.parameters)))
    return table(rows)
