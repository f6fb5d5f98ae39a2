"""Ctrl-C, which reaches every process of a terminal at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def held_back() -> Iterator[None]:
    """Keeps interruptions back. A process that is started meanwhile never gets one, not even while
    it imports its packages; this one gets it behind."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It is started with the first process, and lets interruptions through when it is.
    resource_tracker.ensure_running()
    came: list[int] = []
    first = threading.current_thread() is threading.main_thread()
    # A mask is a thread's own: another thread may take the signal, and the first one handles it.
    usual = signal.signal(signal.SIGINT, lambda number, _: came.append(number)) if first else None
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if first:
            signal.signal(signal.SIGINT, usual)
        if came:
            signal.raise_signal(signal.SIGINT)
