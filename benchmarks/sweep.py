"""`python -m benchmarks.sweep`: overhead, scaling and memory of a sweep."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from experiments import EXPERIMENTS
from machines import DEFAULT_MACHINE
from rigtwin.console import table
from rigtwin.description.catalogue import find
from rigtwin.description.changes import override
from rigtwin.studies.sweep import Store, Workers, open_workers, run_jobs
from rigtwin.studies.tuning.measures import MEASURES
from rigtwin.studies.tuning.run import Run, run

Process = subprocess.Popen[Any]
ROUNDS = 5
RUNS = 48
"""Runs per round, tests of 6 s."""
TRIVIAL = 2000
MANY, GENERATION = 10_000, 500
EXPERIMENT = EXPERIMENTS["active"]
MACHINE = str(find(DEFAULT_MACHINE).path)
MEASURED = (MEASURES["ride"], MEASURES["road_holding"])


def new_runs(seconds: float, count: int, first: int = 0) -> Iterator[tuple[str, Run]]:
    """Yield new runs with their keys; seconds: of each test, first: first seed."""
    configuration = override(EXPERIMENT.configuration, {"timing": {"duration": seconds}})
    for seed in range(first, first + count):
        job = Run(MACHINE, EXPERIMENT, configuration, seed, 0.0, MEASURED)
        yield job.key, job


def empty_run(_: Run) -> dict[str, float]:
    """Return the measures of a run without running it."""
    return {"ride": 0.0, "road_holding": 0.0, "limits": 0.0, "trip": 0.0}


def time_round(workers: Workers, folder: Path, number: int) -> float:
    """Return the time of a round with warm workers, s."""
    with Store(folder / f"{number}-{workers.capacity}.sqlite") as store:
        begin = time.perf_counter()
        run_jobs(store, workers, run, new_runs(6.0, RUNS, 1000 * number))
        return time.perf_counter() - begin


def time_alone(job: Run) -> float:
    """Return the time that one process needs for half a round, s."""
    begin = time.perf_counter()
    for _, repeat in new_runs(6.0, RUNS // 2, job.seed):
        run(repeat)
    return time.perf_counter() - begin


def scaling(folder: Path) -> None:
    """Print the speed-up of two workers, and that of two independent processes as the bound."""
    ratios, machine = [], []
    with (
        open_workers(1) as single_worker,
        open_workers(2) as two_workers,
        multiprocessing.get_context("spawn").Pool(2) as pool,
    ):
        jobs = [job for _, job in new_runs(6.0, 2)]
        time_round(single_worker, folder, 900)
        time_round(two_workers, folder, 900)
        pool.map(time_alone, jobs, chunksize=1)
        for number in range(ROUNDS):
            ratios.append(
                time_round(single_worker, folder, number) / time_round(two_workers, folder, number)
            )
            single = pool.apply(time_alone, (jobs[0],))
            machine.append(2.0 * single / max(pool.map(time_alone, jobs, chunksize=1)))
    print(
        f"1 → 2 workers: {statistics.median(ratios):.2f} times as "
        f"fast ({min(ratios):.2f} to {max(ratios):.2f})"
    )
    print(
        f"two independent processes: {statistics.median(machine):.2f} "
        f"times ({min(machine):.2f} to {max(machine):.2f})"
    )


def overhead(folder: Path) -> None:
    """Print the overhead of a run, ms: its key, its transport both ways, and the store."""
    rows = [("workers", "ms a run")]
    for count in (1, 2):
        with open_workers(count) as workers, Store(folder / f"overhead-{count}.sqlite") as store:
            run_jobs(store, workers, empty_run, new_runs(6.0, 50, 10**6))
            begin = time.perf_counter()
            run_jobs(store, workers, empty_run, new_runs(6.0, TRIVIAL))
            rows.append((str(count), f"{1e3 * (time.perf_counter() - begin) / TRIVIAL:.2f}"))
    with (
        cluster(folder) as (address, _, _),
        open_workers(None, address) as workers,
        Store(folder / "overhead-cluster.sqlite") as store,
    ):
        run_jobs(store, workers, empty_run, new_runs(6.0, 50, 10**6))
        begin = time.perf_counter()
        run_jobs(store, workers, empty_run, new_runs(6.0, TRIVIAL))
        rows.append(
            (
                f"cluster of {workers.capacity}",
                f"{1e3 * (time.perf_counter() - begin) / TRIVIAL:.2f}",
            )
        )
    print(table(rows))


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, Callable[[], Process], list[Process]]]:
    """Start a scheduler with two workers on this computer.

    Yields its address, a function that starts another worker, and the processes, scheduler first.
    """
    file = folder / "scheduler.json"
    common = ["--scheduler-file", str(file), "--no-dashboard", "--host", "127.0.0.1"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    begin = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", *common]
    processes = [subprocess.Popen(begin, env=environment, **quiet)]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny"]

    def start() -> Process:
        return subprocess.Popen([*worker, *common], env=environment, **quiet)

    processes += [start(), start()]
    try:
        time.sleep(10.0)
        yield json.loads(file.read_text())["address"], start, processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def resident(process: int) -> float:
    """Return the memory of a process, MB."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory(folder: Path) -> None:
    """Print the memory of the program and its workers over many short runs."""
    rows = [("runs", "program, MB", "a worker, MB")]
    with open_workers(2) as workers, Store(folder / "memory.sqlite") as store:
        for finished in range(0, MANY, GENERATION):
            run_jobs(store, workers, run, new_runs(0.05, GENERATION, finished))
            if finished + GENERATION in (1000, 2500, 5000, 7500, MANY):
                workers_of_pool = [
                    child.pid
                    for child in multiprocessing.active_children()
                    if child.pid is not None
                ]
                largest = max(map(resident, workers_of_pool))
                rows.append(
                    (str(finished + GENERATION), f"{resident(os.getpid()):.1f}", f"{largest:.1f}")
                )
    print(table(rows))


def campaign(folder: Path) -> None:
    """Run 10 000 runs on a cluster whose workers change, and compare all results with local ones.

    One of two workers is killed after 3000 runs, and another one starts after 5000.
    """
    kill, begin = 3000, 5000
    rows = [("runs", "s", "workers", "program, MB", "largest worker, MB")]
    with (
        cluster(folder) as (address, start, processes),
        open_workers(None, address) as workers,
        Store(folder / "campaign.sqlite") as store,
    ):
        start_time, finished = time.perf_counter(), 0

        def count(_: int) -> None:
            nonlocal finished
            finished += 1
            if finished == kill:
                processes[1].kill()
                processes[1].wait()
            elif finished == begin:
                processes.append(start())
            if finished % 1000 == 0:
                alive = [process for process in processes[1:] if process.poll() is None]
                seconds, largest = (
                    time.perf_counter() - start_time,
                    max(resident(p.pid) for p in alive),
                )
                sizes = f"{resident(os.getpid()):.1f}", f"{largest:.1f}"
                rows.append((str(finished), f"{seconds:.0f}", str(len(alive)), *sizes))

        run_jobs(store, workers, run, new_runs(0.05, MANY), count)
        wrong = sum(store[key] != run(job) for key, job in new_runs(0.05, MANY))
        print(table(rows))
        print(f"{len(store)} results of {MANY} runs, {wrong} of them differ from local ones")


def main() -> None:
    """Print everything, or the campaign alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaign", action="store_true", help="a worker killed, another begun")
    parsed = parser.parse_args()
    np.seterr(all="raise")
    with tempfile.TemporaryDirectory() as name:
        if parsed.campaign:
            campaign(Path(name))
            return
        scaling(Path(name))
        overhead(Path(name))
        memory(Path(name))


if __name__ == "__main__":
    main()
