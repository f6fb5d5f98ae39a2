"""Who works: this process, processes on this computer, or a cluster.

Each gives the same results; only their order differs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, Protocol

from rigtwin.errors import RigtwinError

MOST_WORKERS = 1024


class Future(Protocol):
    """What concurrent.futures and dask both give back for a job."""

    def result(self) -> Any: ...
    def cancel(self) -> Any: ...
    def add_done_callback(self, fn: Callable[[Any], Any], /) -> Any: ...


class Workers(Protocol):
    """Those who do jobs; a context manager that ends with them.

    Attributes
    ----------
    ahead : int
        Jobs given out for each that is done at a time, so that none waits for the next.
    lost : tuple of exception types
        Those that mean a worker died, not that its job failed.
    capacity : int
        Jobs that are done at a time.
    """

    ahead: int
    lost: tuple[type[BaseException], ...]

    @property
    def capacity(self) -> int: ...
    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future:
        """Give out a job."""
        ...

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next future that is done; RigtwinError if nobody is left to finish any."""
        ...

    def __enter__(self) -> Workers: ...
    def __exit__(self, kind: type[BaseException] | None, /, *_: object) -> None: ...


class _Finished:
    """A job done when it was given."""

    def __init__(self, result: Any) -> None:
        self._result = result

    def result(self) -> Any:
        return self._result

    def cancel(self) -> None: ...

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> None:
        fn(self)


class Here:
    """This process, one job after the other; each is handed on before the next begins."""

    ahead = 1
    lost: tuple[type[BaseException], ...] = ()
    capacity = 1

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future:
        """Do the job at once."""
        return _Finished(function(argument))

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """The future that was done last."""
        return finished.get()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, /, *_: object) -> None: ...


def open_workers(workers: int | None = None, cluster: str | None = None) -> Workers:
    """Open workers as `--workers` and `--cluster` say.

    Parameters
    ----------
    workers : int, optional
        Processes on this computer; one a core unless said.
    cluster : str, optional
        The address of a cluster's scheduler, instead.

    Raises
    ------
    RigtwinError
        For a number that makes no sense, an address that does not answer, or a missing package.
    """
    if cluster is not None:
        if workers is not None:
            given = f"workers {workers}, cluster {cluster}"
            raise RigtwinError(f"{given}: expected one of them; a cluster brings its own workers")
        from rigtwin.studies.sweep.cluster import Cluster

        return Cluster(cluster)
    count = (os.cpu_count() or 1) if workers is None else workers
    if not 1 <= count <= MOST_WORKERS:
        raise RigtwinError(f"workers {count}: expected 1 to {MOST_WORKERS}")
    if count == 1:
        return Here()
    from rigtwin.studies.sweep.processes import Processes

    return Processes(count)
