"""Sweeps: results on disk, workers that die, clusters, and the same answers whoever works."""

from __future__ import annotations

import itertools
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, iterate_results, open_workers, run_jobs
from rigtwin.studies.sweep.cluster import _run_if_same
from rigtwin.studies.sweep.workers import SerialExecutor
from tests.helpers.jobs import always_deadly, deadly, faulty, process, slow, square

VALUES = {
    "number": 0.1 + 0.2,
    "whole": 7,
    "none": float("nan"),
    "endless": float("inf"),
    "text": "°",
    "curve": np.linspace(0.0, 1.0, 7),
    "table": np.arange(6, dtype=np.int32).reshape(2, 3),
    "flags": np.array([True, False]),
    "scalar": np.float64(1.5),
    "list": [1.0, {"deep": np.ones(2)}],
}


def test_a_store_gives_back_to_the_bit(tmp_path):
    with Store(tmp_path / "s.sqlite") as store:
        store["a"] = VALUES
    with Store(tmp_path / "s.sqlite") as store:
        result = store["a"]
        assert list(store.keys()) == ["a"]
    for name in ("number", "whole", "endless", "text", "scalar"):
        assert result[name] == VALUES[name]
    assert np.isnan(result["none"])
    for name in ("curve", "table", "flags"):
        assert np.array_equal(result[name], VALUES[name])
        assert result[name].dtype == VALUES[name].dtype
    assert np.array_equal(result["list"][1]["deep"], np.ones(2))


def test_results_of_other_sources_are_not_taken_for_these(tmp_path):
    with Store(tmp_path / "s.sqlite", "one") as store:
        store["a"] = 1
    with Store(tmp_path / "s.sqlite", "other") as store:
        assert "a" not in store
        with pytest.raises(KeyError):
            store["a"]
        assert len(store) == 0


def test_mistakes_of_a_store_are_one_line(tmp_path):
    (tmp_path / "text.sqlite").write_text(
        "this is no database, and long enough to be read as one" * 10
    )
    with pytest.raises(RigtwinError, match="is not a file of results, or damaged"):
        Store(tmp_path / "text.sqlite")
    with Store(tmp_path / "s.sqlite") as store:
        store["a"] = 1
        with pytest.raises(RigtwinError, match="in use by another run"):
            Store(tmp_path / "s.sqlite")
        with pytest.raises(TypeError, match="a result holds set"):
            store["b"] = {1}
    (tmp_path / "file").write_text("")
    with pytest.raises(RigtwinError, match="cannot"):
        Store(tmp_path / "file" / "s.sqlite")


def test_a_damaged_result_is_one_line(tmp_path):
    with Store(tmp_path / "s.sqlite", "one") as store:
        store["a"] = {"curve": np.arange(5.0)}
    with closing(sqlite3.connect(tmp_path / "s.sqlite")) as base:
        base.execute("UPDATE results SET result = substr(result, 1, 20)")
        base.commit()
    with (
        Store(tmp_path / "s.sqlite", "one") as store,
        pytest.raises(RigtwinError, match="or damaged; remove it"),
    ):
        store["a"]


def test_what_was_done_is_not_done_again(tmp_path):
    ran: list[int] = []

    def counted(number: int) -> int:
        ran.append(number)
        return -number

    steps: list[int] = []
    with Store(tmp_path / "s.sqlite") as store:
        run_jobs(store, SerialExecutor(), counted, ((str(n), n) for n in range(5)))
        run_jobs(store, SerialExecutor(), counted, ((str(n), n) for n in range(8)), steps.append)
        assert [store[str(n)] for n in range(8)] == [-n for n in range(8)]
    assert ran == list(range(8))
    assert sum(steps) == 8


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_answers_do_not_depend_on_the_number_of_workers(count, tmp_path):
    with open_workers(count) as workers, Store(tmp_path / "s.sqlite") as store:
        run_jobs(store, workers, square, ((f"{n:02d}", n) for n in range(20)))
        assert [store[key]["square"] for key in store.keys()] == [float(n * n) for n in range(20)]  # noqa: SIM118


def test_several_processes_work():
    with open_workers(2) as workers:
        results = {
            result
            for _, result in iterate_results(workers, process, ((str(n), n) for n in range(30)))
        }
    assert len(results) == 2
    assert os.getpid() not in results


def test_a_worker_that_is_killed_loses_nothing(tmp_path):
    mark = tmp_path / "mark"
    with open_workers(2) as workers:
        results = dict(
            iterate_results(workers, deadly, ((str(n), (str(mark), n)) for n in range(12)))
        )
    assert mark.exists()
    assert results == {str(n): 10 * n for n in range(12)}


def test_a_job_that_always_kills_its_worker_is_named_in_the_end():
    with (
        pytest.raises(RigtwinError, match="a worker died 3 times over"),
        open_workers(2) as workers,
    ):
        list(iterate_results(workers, always_deadly, ((str(n), n) for n in range(4))))


@pytest.mark.parametrize("count", [1, 2])
def test_a_job_that_fails_ends_the_sweep_and_keeps_what_is_done(count, tmp_path):
    """Of endlessly many: were it not ended, neither would this be."""
    with Store(tmp_path / "s.sqlite") as store:
        with pytest.raises(RigtwinError, match="3 cannot be done"), open_workers(count) as workers:
            run_jobs(store, workers, faulty, ((str(n), n) for n in itertools.count()))
        stored = {int(key) for key in store.keys()}  # noqa: SIM118
    # What was under way beside it may be lost, nothing else.
    assert len({0, 1, 2} - stored) < count
    assert 3 not in stored


def test_jobs_are_taken_as_workers_become_free():
    """Endlessly many may follow; memory holds those under way alone."""
    taken = 0

    def endless():
        nonlocal taken
        while True:
            taken += 1
            yield str(taken), taken

    with open_workers(2) as workers:
        for number, _ in enumerate(iterate_results(workers, square, endless())):
            assert taken - number < 12
            if number == 200:
                break


def test_wrong_workers_are_one_line():
    for count in (0, -1, 100_000):
        with pytest.raises(RigtwinError, match="expected 1 to 1024"):
            open_workers(count)
    with pytest.raises(RigtwinError, match="expected one of them"):
        open_workers(2, "tcp://127.0.0.1:1")


SWEEP = """
import sys
from pathlib import Path
from rigtwin.studies.sweep import Store, open_workers, run_jobs
from tests.helpers.jobs import slow

if __name__ == "__main__":
    with open_workers(2) as workers, Store(Path(sys.argv[1])) as store:
        jobs = ((str(n), n) for n in range(40))
        said = lambda _: print("done", flush=True)  # noqa: E731
        run_jobs(store, workers, slow, jobs, said)
"""


def test_a_sweep_that_is_killed_goes_on_and_leaves_no_worker_behind(tmp_path):
    path = tmp_path / "s.sqlite"
    script = tmp_path / "sweep.py"
    script.write_text(SWEEP)
    root = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(
        [sys.executable, str(script), str(path)], stdout=subprocess.PIPE, text=True, env=environment
    ) as run:
        assert run.stdout is not None
        for _ in range(6):
            assert run.stdout.readline() == "done\n"
        workers = children(run.pid)
        assert len(workers) >= 2
        run.kill()
    deadline = time.monotonic() + 10.0
    while any(map(alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(alive, workers))
    with closing(sqlite3.connect(path)) as base:
        assert base.execute("SELECT COUNT(*) FROM results").fetchone()[0] >= 6
    with Store(path) as store:
        stored = set(store.keys())
        ran: list[int] = []
        run_jobs(
            store, SerialExecutor(), lambda n: ran.append(n) or n, ((str(n), n) for n in range(40))
        )
        assert len(stored) + len(ran) == 40
        assert [store[str(n)] for n in range(40)] == list(range(40))


def children(process: int) -> list[int]:
    return [
        int(child) for child in Path(f"/proc/{process}/task/{process}/children").read_text().split()
    ]


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers, a process each; yields the address and the workers."""
    distributed = pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    quiet = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "cwd": folder,
        "env": environment,
    }
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    local = ["--host", "127.0.0.1"]
    begin = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", *common, *local]
    scheduler = subprocess.Popen(begin, **quiet)
    begin = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        "--nthreads",
        "1",
        "--no-nanny",
        *common,
        *local,
    ]
    workers = [subprocess.Popen(begin, **quiet) for _ in range(2)]
    try:
        deadline = time.monotonic() + 60.0
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(len(workers), timeout=60)
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def joined(address: str):
    """The cluster once both workers are there."""
    deadline = time.monotonic() + 60.0
    while True:
        try:
            workers = open_workers(None, address)
        except RigtwinError:
            workers = None
        if workers is not None and workers.capacity == 2:
            return workers
        assert time.monotonic() < deadline
        time.sleep(0.2)


@pytest.mark.slow
def test_a_cluster_gives_the_same_answers_and_may_lose_a_worker(cluster, tmp_path):
    address, processes = cluster
    with joined(address) as workers, Store(tmp_path / "s.sqlite") as store:
        done = 0

        def progress(_: int) -> None:
            nonlocal done
            done += 1
            if done == 10:
                processes[0].kill()

        run_jobs(store, workers, slow, ((f"{n:02d}", n) for n in range(60)), progress)
        assert [store[key] for key in store.keys()] == list(range(60))  # noqa: SIM118
    assert processes[0].wait() == -signal.SIGKILL
    assert done == 60


STUDY = """
experiment = "active"
roads = 1
held_out = 6
evaluations = 5
minimise = "ride"
[set]
"timing.duration" = 1.5
"timing.timestep" = 1e-3
[parameters]
"controller.skyhook_damping" = [50.0, 1500.0]
"""


@pytest.mark.slow
def test_tune_says_the_same_on_a_cluster(cluster, tmp_path, capsys):
    address, _ = cluster
    (tmp_path / "study.toml").write_text(STUDY)
    for name, workers in (("here", ["--workers", "1"]), ("there", ["--cluster", address])):
        assert (
            main(["tune", str(tmp_path / "study.toml"), "--out", str(tmp_path / name), *workers])
            == 0
        )
    capsys.readouterr()
    for file in ("tuned.toml", "candidates.csv", "held-out.csv", "index.html", "best.mcap"):
        assert (tmp_path / "here" / file).read_bytes() == (tmp_path / "there" / file).read_bytes()


@pytest.mark.slow
def test_a_failing_job_on_a_cluster_is_one_line(cluster):
    address, _ = cluster
    with (
        pytest.raises(RigtwinError, match="3 cannot be done"),
        open_workers(None, address) as workers,
    ):
        list(iterate_results(workers, faulty, ((str(n), n) for n in range(10))))


def test_a_worker_with_other_sources_is_refused():
    with pytest.raises(RigtwinError, match="another version of rigtwin"):
        _run_if_same("0" * 12, square, 2)


@pytest.mark.slow
def test_a_cluster_that_is_not_there_is_one_line():
    pytest.importorskip("distributed")
    with pytest.raises(RigtwinError, match="no cluster at"):
        open_workers(None, "tcp://127.0.0.1:9")
