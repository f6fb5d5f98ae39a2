"""Worker processes on this computer."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from typing import Any

import threadpoolctl

from rigtwin.interruptions import held_back

ENDING = 2.0
"""s that a worker may take to end."""


def _set_up(folder: str) -> None:
    """In a worker: leave interruptions to the parent, end with it, keep to one core, and put
    temporary files where the parent clears them away."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
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
        self._folder = TemporaryDirectory(prefix="rigtwin-workers-", ignore_cleanup_errors=True)
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.capacity, spawn, _set_up, (self._folder.name,))

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Give a job to the pool."""
        with held_back():
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

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._folder:
            if kind is None:
                self._pool.shutdown()
                return
            # Interrupted: what is half done is not worth waiting for.
            self._pool.shutdown(wait=False, cancel_futures=True)
            left = multiprocessing.active_children()
            for process in left:
                process.terminate()
            for process in left:
                process.join(ENDING)
