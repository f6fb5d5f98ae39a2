"""Jobs done by workers, with results yielded as they come or put into a store."""

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
"""Key of a job's result, and the argument of its function."""
MOST_LOSSES = 3
"""Number of workers that may die over one job before the job is refused."""


def run_jobs(
    store: Store,
    workers: Workers,
    function: Callable[[Any], Any],
    jobs: Iterable[Job],
    progress: Callable[[int], object] = lambda _: None,
) -> None:
    """Compute the results that a store lacks.

    Results that are finished stay stored, whatever ends the sweep early. Memory does not grow with
    the number of jobs.
    Parameters
    ----------
    store : Store
        Results by the keys of their jobs.
    workers : Workers
        Workers that do the jobs.
    function : callable
        Function of a module, so that processes can import it. It is called with a job's argument.
    jobs : iterable of (str, object)
        Key and argument of each job.
    progress : callable, optional
        Function called with 1 for each stored result.

    Raises
    ------
    RigtwinError
        If workers keep dying or a result cannot be written. Errors of a job propagate.
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
    workers: Workers, function: Callable[[Any], Any], jobs: Iterable[Job]
) -> Iterator[tuple[str, Any]]:
    """Yield the key and the result of every job, in the order in which they finish.

    Parameters
    ----------
    workers : Workers
        Workers that do the jobs. A job whose worker dies is submitted again.
    function : callable
        Function of a module, so that processes can import it. It is called with a job's argument.
    jobs : iterable of (str, object)
        Key and argument of each job. Jobs are drawn as workers become free, so the iterable may
        be endless.

    Raises
    ------
    RigtwinError
        If workers keep dying over a job. Errors of a job propagate.
    """
    # Futures report themselves to a queue: unlike waiting on a set of futures, a queue costs the
    # same for any number of pending jobs.
    coming = iter(jobs)
    finished: SimpleQueue[Any] = SimpleQueue()
    waiting: dict[Any, Job] = {}
    losses: Counter[str] = Counter()

    def submit(job: Job) -> None:
        future = workers.submit(function, job[1])
        waiting[future] = job
        future.add_done_callback(finished.put)

    # Enough jobs are in transit that no worker waits, and no more: memory stays bounded.
    ahead = workers.ahead * workers.capacity
    try:
        for job in islice(coming, ahead):
            submit(job)
        while waiting:
            future = workers.next(finished)
            key, argument = waiting.pop(future)
            try:
                result = future.result()
            # A dead worker may be chance, such as a lack of memory, so the job gets further
            # attempts.
            except workers.lost:
                losses[key] += 1
                _require_survival(key, losses[key])
                submit((key, argument))
                continue
            # Counts of jobs that are done would otherwise grow with the sweep.
            losses.pop(key, None)
            yield key, result
            for job in islice(coming, ahead - len(waiting)):
                submit(job)
    # Also runs when the consumer stops early or an error propagates.
    finally:
        for future in waiting:
            future.cancel()


def _require_survival(key: str, losses: int) -> None:
    """Raise RigtwinError if too many workers have died over one job."""
    if losses >= MOST_LOSSES:
        causes = "out of memory, killed, or it could not start"
        raise RigtwinError(f"a worker died {MOST_LOSSES} times over {key}: {causes}") from None
