"""Jobs done by workers, their results as they come or in a store."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from queue import SimpleQueue
from typing import Any

from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep.store import Store
from rigtwin.studies.sweep.workers import Workers

Job = tuple[str, Any]
"""Key and argument."""
MOST_LOSSES = 3
"""Times that a worker may die over one job before the job is to blame."""


def run_jobs(
    store: Store,
    workers: Workers,
    function: Callable[[Any], Any],
    jobs: Iterable[Job],
    progress: Callable[[int], object] = lambda _: None,
) -> None:
    """Put every job's result into the store, unless it is there.

    Whatever ends this early, what is done stays done. Memory does not grow with the number of jobs.

    Parameters
    ----------
    store : Store
        Where results are kept, by the keys of their jobs.
    workers : Workers
        Who does the jobs.
    function : callable
        Of a module; called with a job's argument.
    jobs : iterable of (str, object)
        Key and argument of each.
    progress : callable, optional
        Called with 1 for each result that is there.

    Raises
    ------
    RigtwinError
        If workers keep dying or a result cannot be written. What a job raises is raised too.
    """

    def iterate_missing() -> Iterator[Job]:
        for key, argument in jobs:
            if key in store:
                progress(1)
            else:
                yield key, argument

    for key, result in iterate_results(workers, function, iterate_missing()):
        store[key] = result
        progress(1)


def iterate_results(
    workers: Workers,
    function: Callable[[Any], Any],
    jobs: Iterable[Job],
) -> Iterator[tuple[str, Any]]:
    """Yield every job's key and result as they are done.

    Parameters
    ----------
    workers : Workers
        Who does the jobs. A job whose worker dies is given out again.
    function : callable
        Of a module; called with a job's argument.
    jobs : iterable of (str, object)
        Key and argument, taken as workers become free: as many may follow as there is time for.

    Raises
    ------
    RigtwinError
        If workers keep dying over a job. What a job raises is raised too.
    """
    coming = iter(jobs)
    finished: SimpleQueue[Any] = SimpleQueue()
    waiting: dict[Any, Job] = {}
    losses: Counter[str] = Counter()

    def submit(job: Job) -> None:
        future = workers.submit(function, job[1])
        waiting[future] = job
        future.add_done_callback(finished.put)

    ahead = workers.ahead * workers.capacity
    try:
        for job in islice(coming, ahead):
            submit(job)
        while waiting:
            future = workers.next(finished)
            key, argument = waiting.pop(future)
            try:
                result = future.result()
            except workers.lost:
                losses[key] += 1
                if losses[key] >= MOST_LOSSES:
                    why = "out of memory, killed, or it could not start"
                    told = f"a worker died {MOST_LOSSES} times over {key}: {why}"
                    raise RigtwinError(told) from None
                submit((key, argument))
                continue
            losses.pop(key, None)
            yield key, result
            for job in islice(coming, ahead - len(waiting)):
                submit(job)
    finally:
        for future in waiting:
            future.cancel()
