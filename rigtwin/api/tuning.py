"""Tuning of a controller on the twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from experiments.tuning import find_study
from rigtwin.api.machines import resolve_machine
from rigtwin.api.studies import Progress, count_steps, ignore_progress
from rigtwin.description.machine import Machine
from rigtwin.description.posterior import load_posterior
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, open_workers
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.folder import RUNS, default_folder, write
from rigtwin.studies.tuning.result import TuningResult, count_runs
from rigtwin.studies.tuning.result import tune as tune_study


def tune(
    study: str,
    *,
    machine: Machine | str | Path | None = None,
    settings: Sequence[str] = (),
    twin: str | Path | None = None,
    out: str | Path | None = None,
    seed: int = 1,
    evaluations: int | None = None,
    roads: int | None = None,
    held_out: int | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = ignore_progress,
    stage: Callable[[str], object] = ignore_progress,
) -> TuningResult:
    """Tune a controller on the twin, and judge it on roads that the tuning has not used.

    Parameters
    ----------
    study
        Name of a shipped study, or the path of a study's file (docs/tuning.md).
    machine
        Machine whose controller is tuned, or its name, or the path of its description. Defaults to
        the machine that the study names, or else to the suspension rig.
    settings
        Changes `group.name=value` of every run. They override the study's own.
    twin
        File of a calibrated twin, as `Diagnosis.save_twin` writes it. The scenarios are drawn
        from its uncertainty.
    out
        Folder of the results, `tuning/STUDY` by default. Runs that it contains are not repeated.
    seed
        Seed of the optimiser, at least 0. The same seed gives the same settings.
    evaluations
        Approximate number of candidates. Defaults to the study's.
    roads
        Number of scenarios in which every candidate is tried. Defaults to the study's.
    held_out
        Number of scenarios for the judgement. Defaults to the study's.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished runs and with the expected total.
    stage
        Function called with the name of each stage as it begins.

    Returns
    -------
    TuningResult
        `chosen`, the recommended candidate with its settings and scores; `front`, the Pareto front
        of two objectives; `comparisons` of the baseline and the tuned settings on held-out
        scenarios. The folder contains a page and `tuned.toml`, for `--config`.

    Raises
    ------
    RigtwinError
        For a mistake in the study, or if no candidate meets its constraints.

    Examples
    --------
    >>> result = rigtwin.tune("skyhook", out="tuning/skyhook", roads=4)  # doctest: +SKIP
    >>> result.chosen  # doctest: +SKIP
    """
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    loaded = find_study(
        study,
        settings,
        machine=None if machine is None else resolve_machine(machine),
        roads=roads,
        held_out=held_out,
        evaluations=evaluations,
    )
    base = loaded.machine.configuration
    posterior = None if twin is None else load_posterior(Path(twin), base)
    folder = Path(out) if out is not None else default_folder(loaded)
    if folder.exists() and not folder.is_dir():
        raise RigtwinError(f"cannot write into {folder}: it is a file")
    step = count_steps(progress, count_runs(loaded, posterior))
    with open_workers(workers, cluster) as open_, Store(folder / RUNS) as store:
        result = tune_study(Bench(loaded, store, open_, step), seed, posterior, stage)
    # The recording of the result is of the likeliest rig, not of the nominal one.
    tuned_on = loaded.configuration
    write(folder, result, tuned_on if posterior is None else posterior.at_best(tuned_on))
    return result
