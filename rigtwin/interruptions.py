"""Ctrl-C: a signal that reaches every process of a terminal at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rigtwin.system import no_interrupts


@contextmanager
def defer_sigint() -> Iterator[None]:
    """Defer an interruption to the end of this context.

    A compiled function that is interrupted while it receives its arguments loses one of them, and
    reports that part of it as missing.
    """
    # Python handles signals in the main thread only.
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
    """Block interruptions in this context.

    A process started inside never receives one, not even while it imports its packages. This
    process receives it at the end.
    """
    # A signal mask belongs to one thread. Another thread may take the signal and pass it to the
    # main thread, whose handler must therefore be deferred too.
    with defer_sigint(), no_interrupts():
        yield
