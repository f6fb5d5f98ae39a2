"""Ctrl-C, which reaches every process of a terminal at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rigtwin.system import no_interrupts


@contextmanager
def deferred() -> Iterator[None]:
    """Lets an interruption come behind what runs here, not within: a compiled function that is
    handed its arguments loses one, and says that something of them is missing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    usual = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def block_sigint() -> Iterator[None]:
    """Keeps interruptions back. A process that is started meanwhile never gets one, not even while
    it imports its packages; this one gets it behind."""
    # What is kept back is a thread's own: another thread may take it, and the first one handles it.
    with deferred(), no_interrupts():
        yield
