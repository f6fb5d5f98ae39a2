"""Stop requests of an operator: a signal, a key, or a file."""

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
    """Provide a function that returns who asked to stop, or None; to be called once a tick.

    Inside this context, Ctrl-C and other signals that end a program are requests. So are any key on
    a terminal, and the existence of the file.
    """
    requests: list[str] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        requests.append(f"stopped by the operator: {signal.Signals(number).name}")

    # A handler only takes a note: it may run between any two instructions of the loop.
    before = {number: signal.signal(number, on_signal) for number in STOP_SIGNALS}
    path = None if file is None else os.fspath(file)
    try:
        with read_keys() as key_pressed:

            def find_request() -> str | None:
                if requests:
                    # The first request is the cause; impatient repetitions of Ctrl-C change
                    # nothing.
                    return requests[0]
                if path is not None and os.path.exists(path):  # noqa: PTH110 - 1 us instead of 3, every tick
                    return f"stopped by the operator: file {path}"
                if key_pressed is not None and key_pressed():
                    return "stopped by the operator: key"
                return None

            yield find_request
    finally:
        # The program's own handlers are restored, so that Ctrl-C ends it again.
        for number, handler in before.items():
            signal.signal(number, handler)
