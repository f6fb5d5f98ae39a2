"""Who works: this process, processes on this computer, or a cluster. Each gives the same results; only their order differs."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Protocol

from rigtwin.errors import RigtwinError

MOST_LOSSES = 3
"""Times that a worker may die over one job before the job is to blame."""
MOST_WORKERS = 1024


class Future(Protocol):
    """What concurrent.futures and dask both give back for a job."""

    def result(self) -> Any: ...
    def cancel(self) -> Any: ...
    def add_done_callback(self, fn: Callable[[Any], Any], /) -> Any: ...


class Workers(Protocol):
    """capacity: jobs that are done at a time; ahead: given out for each of them, so that none waits for the next; lost: the
    exceptions that mean a worker died, not that its job failed."""

    ahead: int
    lost: tuple[type[BaseException], ...]

    @property
    def capacity(self) -> int: ...
    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future: ...
    def next(self, finished: SimpleQueue[Any]) -> Any:
        """The next future that is done. Raises RigtwinError if nobody is left to finish any."""
        ...

    def __enter__(self) -> Workers: ...
    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


class _Done:
    """A job done when it was given."""

    def __init__(self, result: Any) -> None:
        self._result = result

    def result(self) -> Any:
        return self._result

    def cancel(self) -> None: ...

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> None:
        fn(self)


class Here:
    """This process, one job after the other; what is done is handed on before the next begins."""

    ahead = 1
    lost: tuple[type[BaseException], ...] = ()
    capacity = 1

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future:
        return _Done(function(argument))

    def next(self, finished: SimpleQueue[Any]) -> Any:
        return finished.get()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


def hired(workers: int | None = None, cluster: str | None = None) -> Workers:
    """As `--workers` and `--cluster` say: a number of processes (default: one a core), or a cluster by its address.

    Raises RigtwinError for a number that makes no sense, an address that does not answer, or a missing package.
    """
    if cluster is not None:
        if workers is not None:
            raise RigtwinError(
                f"--workers {workers} --cluster {cluster}: expected one of them; a cluster brings its own workers"
            )
        from rigtwin.studies.sweep.cluster import Cluster

        return Cluster(cluster)
    count = (os.cpu_count() or 1) if workers is None else workers
    if not 1 <= count <= MOST_WORKERS:
        raise RigtwinError(f"--workers {count}: expected 1 to {MOST_WORKERS}")
    if count == 1:
        return Here()
    from rigtwin.studies.sweep.processes import Processes

    return Processes(count)


def each(workers: Workers, function: Callable[[Any], Any], jobs: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """Every job's key and result as they are done. function: of a module, called with a job's argument; jobs: key and
    argument, taken as workers become free, so that as many may follow as there is time for.

    A job whose worker dies is given out again. Raises RigtwinError if that keeps happening, and what a job raises.
    """
    coming = iter(jobs)
    finished: SimpleQueue[Any] = SimpleQueue()
    waiting: dict[Any, tuple[str, Any]] = {}
    losses: Counter[str] = Counter()

    def give(job: tuple[str, Any]) -> None:
        future = workers.submit(function, job[1])
        waiting[future] = job
        future.add_done_callback(finished.put)

    ahead = workers.ahead * workers.capacity
    try:
        for job in islice(coming, ahead):
            give(job)
        while waiting:
            future = workers.next(finished)
            key, argument = waiting.pop(future)
            try:
                result = future.result()
            except workers.lost:
                losses[key] += 1
                if losses[key] >= MOST_LOSSES:
                    why = "out of memory, killed, or it could not start"
                    raise RigtwinError(f"a worker died {MOST_LOSSES} times over {key}: {why}") from None
                give((key, argument))
                continue
            losses.pop(key, None)
            yield key, result
            for job in islice(coming, ahead - len(waiting)):
                give(job)
    finally:
        for future in waiting:
            future.cancel()
