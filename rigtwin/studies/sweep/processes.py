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

from rigtwin.interruptions import block_sigint

ENDING = 2.0
"""Time a worker may take to end, in s."""


def _set_up(folder: str) -> None:
    """Prepare a worker process.

    The worker ignores interruptions, which the parent handles, and ends with the parent. It uses
    one core, and puts temporary files where the parent deletes them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A killed worker cannot clean up; the parent deletes the folder.
    tempfile.tempdir = folder
    # The sweep already uses every core; threads of linear algebra would compete for them.
    threadpoolctl.threadpool_limits(1)
    parent = multiprocessing.parent_process()

    # A killed parent cannot tell its workers to end; this thread notices and ends the worker.
    def follow_parent() -> None:
        if parent is not None:
            parent.join()
        # sys.exit would end only this thread; os._exit ends the process without clean-up.
        os._exit(1)

    threading.Thread(target=follow_parent, daemon=True).start()


class Processes:
    """Pool of worker processes. A pool that breaks because a process died is replaced.

    Parameters
    ----------
    capacity : int
        Number of processes.
    """

    ahead = 3
    lost: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._folder = TemporaryDirectory(prefix="rigtwin-workers-", ignore_cleanup_errors=True)
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        # Forking would copy threads' locks in whatever state they are; spawn starts afresh.
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.capacity, spawn, _set_up, (self._folder.name,))

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Submit a job to the pool."""
        # submit() may start processes; Ctrl-C in between would leave the pool half started.
        with block_sigint():
            try:
                return self._pool.submit(function, argument)
            except BrokenProcessPool:
                self._pool.shutdown(wait=False)
                self._pool = self._start()
                return self._pool.submit(function, argument)

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next finished future."""
        return finished.get()

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._folder:
            if kind is None:
                self._pool.shutdown()
                return
            # After an interruption, results in progress are not worth waiting for.
            self._pool.shutdown(wait=False, cancel_futures=True)
            remaining = multiprocessing.active_children()
            for process in remaining:
                process.terminate()
            for process in remaining:
                process.join(ENDING)
