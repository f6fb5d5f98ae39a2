"""Jobs done by workers, their results in a store."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rigtwin.studies.sweep.store import Store
from rigtwin.studies.sweep.workers import Workers, each


def swept(
    store: Store,
    workers: Workers,
    function: Callable[[Any], Any],
    jobs: Iterable[tuple[str, Any]],
    progress: Callable[[int], object] = lambda _: None,
) -> None:
    """Puts every job's result into the store, unless it is there; whatever ends this early, what is done stays done.

    jobs: key and argument; progress: called with 1 for each result that is there. Memory does not grow with their number.
    Raises what a job raises, and RigtwinError if workers keep dying or a result cannot be written.
    """

    def missing() -> Iterable[tuple[str, Any]]:
        for key, argument in jobs:
            if key in store:
                progress(1)
            else:
                yield key, argument

    for key, result in each(workers, function, missing()):
        store[key] = result
        progress(1)
