"""Parallel work of a search in threads.

The compiled models release the interpreter lock while they run, so that threads suffice and nothing
has to be copied between processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

THREADS = 2
"""Number of threads."""
Item = TypeVar("Item")
Result = TypeVar("Result")


class Threads:
    """Thread pool of a search.

    Used as a context manager: leaving it waits for the threads, or cancels the items not yet begun
    if an exception is raised.

    Parameters
    ----------
    progress
        Called with 1 after every fit of `map`.
    """

    def __init__(self, progress: Callable[[int], object] = lambda _: None) -> None:
        self._progress = progress
        self._pool = ThreadPoolExecutor(THREADS)

    def __enter__(self) -> Threads:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # After Ctrl-C or an error the results are not needed, so the queue is dropped at once. A
        # running item cannot be stopped.
        self._pool.shutdown(wait=kind is None, cancel_futures=kind is not None)

    def begin(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Begin the function on every item, and yield the results in the order of the items.

        All items are submitted at once. The iterator waits only for the result it yields next.
        """
        return self._pool.map(function, items)

    def spread(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Return the function's results in the order of the items, without reporting progress."""
        return list(self._pool.map(function, items))

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Return the results in the order of the items, and report each as progress."""
        results = []
        for result in self._pool.map(function, items):
            results.append(result)
            self._progress(1)
        return results
