"""How an operator stops a session at any time: a signal, a key, a file."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from rigtwin.system import STOP_SIGNALS, read_keys


@contextmanager
def stop_requests(file: Path | None = None) -> Iterator[Callable[[], str | None]]:
    """Gives a function to be called once a tick: who asked to stop, or None.

    Ctrl-C and the other signals that end a program are requests inside this context; on a terminal
    so is any key; so is a file of that name.
    """
    said: list[str] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        said.append(f"stopped by the operator: {signal.Signals(number).name}")

    before = {number: signal.signal(number, on_signal) for number in STOP_SIGNALS}
    path = None if file is None else os.fspath(file)
    try:
        with read_keys() as key_pressed:

            def find_request() -> str | None:
                if said:
                    return said[0]
                if path is not None and os.path.exists(path):  # noqa: PTH110 - 1 us instead of 3, every tick
                    return f"stopped by the operator: file {path}"
                if key_pressed is not None and key_pressed():
                    return "stopped by the operator: key"
                return None

            yield find_request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
