"""Worker processes on this computer."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from queue import SimpleQueue
from types import TracebackType
from typing import Any

import threadpoolctl


def _set_up() -> None:
    """In a worker: leave interruptions to the parent, end with it, and keep to one core."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpoolctl.threadpool_limits(1)
    parent = multiprocessing.parent_process()

    def follow_parent() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=follow_parent, daemon=True).start()


class Processes:
    """A number of processes. One that dies breaks the pool, which is then made anew.

    Parameters
    ----------
    capacity : int
        How many.
    """

    ahead = 3
    lost: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.capacity, multiprocessing.get_context("spawn"), _set_up)

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Give a job to the pool."""
        try:
            return self._pool.submit(function, argument)
        except BrokenProcessPool:
            self._pool.shutdown(wait=False)
            self._pool = self._start()
            return self._pool.submit(function, argument)

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next future that is done."""
        return finished.get()

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._pool.shutdown()
            return
        # Interrupted: what is half done is not worth waiting for.
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()
