"""Workers of a sweep: this process, processes on this computer, or a cluster.

All of them compute the same results; only the order differs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, Protocol

from rigtwin.errors import RigtwinError

MOST_WORKERS = 1024
"""Upper bound on processes, against a slip of the hand."""


class Future(Protocol):
    """Interface that futures of concurrent.futures and of dask have in common."""

    def result(self) -> Any: ...
    def cancel(self) -> Any: ...
    def add_done_callback(self, fn: Callable[[Any], Any], /) -> Any: ...


class Workers(Protocol):
    """Interface of a pool of workers; a context manager that ends them.

    Attributes
    ----------
    ahead : int
        Number of jobs submitted per unit of capacity, so that no worker waits for its next job.
    lost : tuple of exception types
        Exception types that mean the worker died, not that the job failed.
    capacity : int
        Number of jobs that are done at a time.
    """

    ahead: int
    lost: tuple[type[BaseException], ...]

    @property
    def capacity(self) -> int: ...
    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future:
        """Submit a job."""
        ...

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next finished future. Raise RigtwinError if no worker remains."""
        ...

    def __enter__(self) -> Workers: ...
    def __exit__(self, kind: type[BaseException] | None, /, *_: object) -> None: ...


class _Finished:
    """Future of a job that was done on submission."""

    def __init__(self, result: Any) -> None:
        self._result = result

    def result(self) -> Any:
        return self._result

    def cancel(self) -> None: ...

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> None:
        fn(self)


class SerialExecutor:
    """Worker that does one job after another in this process.

    A result is yielded before the next job begins.
    """

    ahead = 1
    lost: tuple[type[BaseException], ...] = ()
    capacity = 1

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future:
        """Do the job at once."""
        return _Finished(function(argument))

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Return the future of the job done last."""
        return finished.get()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, /, *_: object) -> None: ...


def open_workers(workers: int | None = None, cluster: str | None = None) -> Workers:
    """Open the workers that the options `--workers` and `--cluster` ask for.

    Parameters
    ----------
    workers : int, optional
        Number of processes on this computer. Defaults to one per core.
    cluster : str, optional
        Address of a cluster's scheduler, in place of processes.

    Raises
    ------
    RigtwinError
        If the number is out of range, the address does not answer, or a package is missing.
    """
    if cluster is not None:
        if workers is not None:
            options = f"workers {workers}, cluster {cluster}"
            raise RigtwinError(f"{options}: expected one of them; a cluster has its own workers")
        # Imported only if asked for: dask is an optional dependency.
        from rigtwin.studies.sweep.cluster import Cluster

        return Cluster(cluster)
    count = (os.cpu_count() or 1) if workers is None else workers
    if not 1 <= count <= MOST_WORKERS:
        raise RigtwinError(f"workers {count}: expected 1 to {MOST_WORKERS}")
    # One worker needs no process of its own; errors then have a plain traceback.
    if count == 1:
        return SerialExecutor()
    from rigtwin.studies.sweep.processes import Processes

    return Processes(count)
