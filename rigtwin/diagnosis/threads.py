"""Work of a search side by side: the compiled models leave the interpreter free."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

THREADS = 2
"""That work at a time."""
Item = TypeVar("Item")
Found = TypeVar("Found")


class Threads:
    """A few threads; progress is told of every item that is done."""

    def __init__(self, progress: Callable[[int], object] = lambda _: None) -> None:
        self._progress = progress
        self._pool = ThreadPoolExecutor(THREADS)

    def __enter__(self) -> Threads:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Interrupted: what has not begun need not be done.
        self._pool.shutdown(wait=kind is None, cancel_futures=kind is not None)

    def begin(self, function: Callable[[Item], Found], items: Iterable[Item]) -> Iterator[Found]:
        """What a function makes of every item, begun at once and waited for when it is taken."""
        return self._pool.map(function, items)

    def spread(self, function: Callable[[Item], Found], items: Iterable[Item]) -> list[Found]:
        """What a function makes of every item, in their order; nothing is told."""
        return list(self._pool.map(function, items))

    def map(self, function: Callable[[Item], Found], items: Iterable[Item]) -> list[Found]:
        """The same of fits, each of which is told."""
        results = []
        for found in self._pool.map(function, items):
            results.append(found)
            self._progress(1)
        return results
