"""`python -m benchmarks.sweep`: what a sweep costs besides its runs, what a second worker brings,
and its memory."""

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
"""Of a round, 6 s of test each."""
TRIVIAL = 2000
MANY, GENERATION = 10_000, 500
EXPERIMENT = EXPERIMENTS["active"]
MACHINE = str(find(DEFAULT_MACHINE).path)
ASKED = (MEASURES["ride"], MEASURES["road_holding"])


def asked(seconds: float, count: int, first: int = 0) -> Iterator[tuple[str, Run]]:
    """Runs that have not been made."""
    configuration = override(EXPERIMENT.configuration, {"timing": {"duration": seconds}})
    for seed in range(first, first + count):
        one = Run(MACHINE, EXPERIMENT, configuration, seed, 0.0, ASKED)
        yield one.key, one


def nothing(_: Run) -> dict[str, float]:
    return {"ride": 0.0, "road_holding": 0.0, "limits": 0.0, "trip": 0.0}


def timed(workers: Workers, folder: Path, number: int) -> float:
    """s of a round's runs, workers warm."""
    with Store(folder / f"{number}-{workers.capacity}.sqlite") as store:
        begin = time.perf_counter()
        run_jobs(store, workers, run, asked(6.0, RUNS, 1000 * number))
        return time.perf_counter() - begin


def alone(job: Run) -> float:
    """s that one process needs for a round's runs, one after the other."""
    begin = time.perf_counter()
    for _, one in asked(6.0, RUNS // 2, job.seed):
        run(one)
    return time.perf_counter() - begin


def scaling(folder: Path) -> None:
    """1 against 2 workers, side by side; and two processes that know nothing of each other, which
    is what the machine gives."""
    ratios, machine = [], []
    with (
        open_workers(1) as one,
        open_workers(2) as two,
        multiprocessing.get_context("spawn").Pool(2) as pool,
    ):
        jobs = [job for _, job in asked(6.0, 2)]
        timed(one, folder, 900)
        timed(two, folder, 900)
        pool.map(alone, jobs, chunksize=1)
        for number in range(ROUNDS):
            ratios.append(timed(one, folder, number) / timed(two, folder, number))
            single = pool.apply(alone, (jobs[0],))
            machine.append(2.0 * single / max(pool.map(alone, jobs, chunksize=1)))
    print(
        f"1 → 2 workers: {statistics.median(ratios):.2f} times as "
        f"fast ({min(ratios):.2f} to {max(ratios):.2f})"
    )
    print(
        f"two processes apart: {statistics.median(machine):.2f} "
        f"times ({min(machine):.2f} to {max(machine):.2f})"
    )


def overhead(folder: Path) -> None:
    """ms a run besides the run: its key, on its way there and back, and into the store."""
    rows = [("workers", "ms a run")]
    for count in (1, 2):
        with open_workers(count) as workers, Store(folder / f"overhead-{count}.sqlite") as store:
            run_jobs(store, workers, nothing, asked(6.0, 50, 10**6))
            begin = time.perf_counter()
            run_jobs(store, workers, nothing, asked(6.0, TRIVIAL))
            rows.append((str(count), f"{1e3 * (time.perf_counter() - begin) / TRIVIAL:.2f}"))
    with (
        cluster(folder) as (address, _, _),
        open_workers(None, address) as workers,
        Store(folder / "overhead-cluster.sqlite") as store,
    ):
        run_jobs(store, workers, nothing, asked(6.0, 50, 10**6))
        begin = time.perf_counter()
        run_jobs(store, workers, nothing, asked(6.0, TRIVIAL))
        rows.append(
            (
                f"cluster of {workers.capacity}",
                f"{1e3 * (time.perf_counter() - begin) / TRIVIAL:.2f}",
            )
        )
    print(table(rows))


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, Callable[[], Process], list[Process]]]:
    """A scheduler with two workers, a process each, on this computer: its address, what begins
    another worker, and the processes, the scheduler's first."""
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
    """MB."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory(folder: Path) -> None:
    """Of the program and its workers over many short runs."""
    rows = [("runs", "program, MB", "a worker, MB")]
    with open_workers(2) as workers, Store(folder / "memory.sqlite") as store:
        for done in range(0, MANY, GENERATION):
            run_jobs(store, workers, run, asked(0.05, GENERATION, done))
            if done + GENERATION in (1000, 2500, 5000, 7500, MANY):
                own = [
                    child.pid
                    for child in multiprocessing.active_children()
                    if child.pid is not None
                ]
                largest = max(map(resident, own))
                rows.append(
                    (str(done + GENERATION), f"{resident(os.getpid()):.1f}", f"{largest:.1f}")
                )
    print(table(rows))


def campaign(folder: Path) -> None:
    """10 000 runs on a cluster of two workers, one of which is killed after three thousand runs and
    another begun after five thousand; whether each result is that of a run here."""
    kill, begin = 3000, 5000
    rows = [("runs", "s", "workers", "program, MB", "largest worker, MB")]
    with (
        cluster(folder) as (address, start, processes),
        open_workers(None, address) as workers,
        Store(folder / "campaign.sqlite") as store,
    ):
        began, done = time.perf_counter(), 0

        def count(_: int) -> None:
            nonlocal done
            done += 1
            if done == kill:
                processes[1].kill()
                processes[1].wait()
            elif done == begin:
                processes.append(start())
            if done % 1000 == 0:
                alive = [each for each in processes[1:] if each.poll() is None]
                seconds, largest = time.perf_counter() - began, max(resident(p.pid) for p in alive)
                sizes = f"{resident(os.getpid()):.1f}", f"{largest:.1f}"
                rows.append((str(done), f"{seconds:.0f}", str(len(alive)), *sizes))

        run_jobs(store, workers, run, asked(0.05, MANY), count)
        wrong = sum(store[key] != run(job) for key, job in asked(0.05, MANY))
        print(table(rows))
        print(f"{len(store)} results of {MANY} runs, {wrong} of them other than here")


def main() -> None:
    """Prints all, or the campaign alone."""
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
