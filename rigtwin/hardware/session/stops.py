"""How an operator stops a session at any time: a signal, a key, a file."""

from __future__ import annotations

import os
import select
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

_SIGNALS = [
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP")
    if hasattr(signal, name)
]


@contextmanager
def stop_requests(file: Path | None = None) -> Iterator[Callable[[], str | None]]:
    """Gives a function to be called once a tick: who asked to stop, or None.

    Ctrl-C and the other signals that end a program are requests inside this context; on a terminal
    so is any key; so is a file of that name.
    """
    said: list[str] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        said.append(f"stopped by the operator: {signal.Signals(number).name}")

    before = {number: signal.signal(number, on_signal) for number in _SIGNALS}
    path = None if file is None else os.fspath(file)
    try:
        with _single_keys() as keys:

            def find_request() -> str | None:
                if said:
                    return said[0]
                if path is not None and os.path.exists(path):  # noqa: PTH110 - 1 us instead of 3, every tick
                    return f"stopped by the operator: file {path}"
                if keys and select.select([sys.stdin], [], [], 0.0)[0]:
                    sys.stdin.read(1)
                    return "stopped by the operator: key"
                return None

            yield find_request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _single_keys() -> Iterator[bool]:
    """Whether there is a terminal whose keys can be read one by one.

    For the time of the context they are.
    """
    try:
        import termios
        import tty
    except ImportError:
        yield False
        return
    if not (sys.stdin and sys.stdin.isatty() and os.getpgrp() == os.tcgetpgrp(sys.stdin.fileno())):
        yield False
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield True
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
