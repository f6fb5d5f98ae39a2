"""Does the jobs of studies side by side, and keeps each result on disk, so that what was done is
never done again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from experiments.thesis.study import Result, Study
from rigtwin.studies.sweep import Store, Workers, run_jobs


def job(which: tuple[str, int, str]) -> Result:
    """The work of one job: a study's name, its number of seeds, the job's key. Runs in any
    process."""
    from experiments.thesis.catalogue import BENCHMARKS, STUDIES

    study, seeds, key = which
    return (STUDIES | BENCHMARKS)[study].jobs(seeds)[key]()


def done(
    studies: Sequence[Study],
    seeds: int,
    folder: Path,
    workers: Workers,
    progress: Callable[[int, int], object] = lambda *_: None,
) -> dict[str, dict[str, Result]]:
    """Results of every job of studies of the catalogue, study → key → result. progress is called
    with (jobs done, jobs in all).

    Interrupted, it keeps what is finished. Raises RigtwinError if the folder cannot be written.
    """
    keys = {study.name: list(study.jobs(seeds)) for study in studies}
    total, count = sum(map(len, keys.values())), 0
    progress(0, total)

    def step(more: int) -> None:
        nonlocal count
        count += more
        progress(count, total)

    with Store(folder / "results.sqlite") as store:
        jobs = [
            (f"{study}/{key}", (study, seeds, key)) for study, own in keys.items() for key in own
        ]
        run_jobs(store, workers, job, jobs, step)
        return {study: {key: store[f"{study}/{key}"] for key in own} for study, own in keys.items()}
