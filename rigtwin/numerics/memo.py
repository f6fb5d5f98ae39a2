"""Memo: the last results of a slow function, by key."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """The last results of a slow function, by key.

    Parameters
    ----------
    most
        Number of results that are kept, at least 1.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: dict[Hashable, Result] = {}

    def recall(self, key: Hashable, compute: Callable[[], Result]) -> Result:
        """Return the result of a key, which `compute` returns the first time; it is never None."""
        result = self._results.get(key)
        if result is None:
            result = compute()
            # A new dictionary takes the old one's place: other threads may be reading that.
            results = {**self._results, key: result}
            for oldest in list(results)[: max(len(results) - self._most, 0)]:
                del results[oldest]
            self._results = results
        return result
