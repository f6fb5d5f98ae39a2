"""Parallel execution of the studies' jobs, with every result stored on disk.

A stored result is never computed again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from experiments.thesis.study import Result, ThesisStudy
from rigtwin.studies.sweep import Store, Workers, run_jobs


def run_job(request: tuple[str, int, str]) -> Result:
    """Return the result of one job: name of the study, number of seeds, key of the job.

    The function runs in any process.
    """
    # Imported here: a worker process loads the studies when it has its first job.
    from experiments.thesis.catalogue import BENCHMARKS, STUDIES

    study, seeds, key = request
    return (STUDIES | BENCHMARKS)[study].jobs(seeds)[key]()


def run_studies(
    studies: Sequence[ThesisStudy],
    seeds: int,
    folder: Path,
    workers: Workers,
    progress: Callable[[int, int], object] = lambda *_: None,
) -> dict[str, dict[str, Result]]:
    """Run the jobs of some studies of the catalogue, and return all their results.

    Parameters
    ----------
    studies : sequence of Study
        Studies to run.
    seeds : int
        Number of seeds.
    folder : Path
        Folder of the stored results. An interrupted run keeps the finished ones.
    workers : Workers
        Processes that run the jobs.
    progress : callable
        Function called with the number of finished jobs and their total.

    Returns
    -------
    dict
        Study → key → result.

    Raises
    ------
    RigtwinError
        If the folder cannot be written.
    """
    keys = {study.name: list(study.jobs(seeds)) for study in studies}
    total, count = sum(map(len, keys.values())), 0
    progress(0, total)

    def step(more: int) -> None:
        nonlocal count
        count += more
        progress(count, total)

    with Store(folder / "results.sqlite") as store:
        # Jobs travel as names, since closures cannot be pickled for another process.
        jobs = [
            (f"{study}/{key}", (study, seeds, key))
            for study, keys_of_study in keys.items()
            for key in keys_of_study
        ]
        run_jobs(store, workers, run_job, jobs, step)
        return {
            study: {key: store[f"{study}/{key}"] for key in keys_of_study}
            for study, keys_of_study in keys.items()
        }
