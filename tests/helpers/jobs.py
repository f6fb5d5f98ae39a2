"""Jobs for a sweep's workers, which import them by name."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from rigtwin.errors import RigtwinError


def square(number: int) -> dict[str, float]:
    return {"square": float(number * number)}


def faulty(number: int) -> int:
    if number == 3:
        raise RigtwinError(f"{number} cannot be done")
    return number


def deadly(argument: tuple[str, int]) -> int:
    """Kills its process the first time that it is called with 5."""
    mark, number = argument
    if number == 5 and not Path(mark).exists():
        Path(mark).write_text("died here")
        os.kill(os.getpid(), signal.SIGKILL)
    return 10 * number


def always_deadly(number: int) -> int:
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def process(_: int) -> int:
    time.sleep(0.02)
    return os.getpid()


def slow(number: int) -> int:
    time.sleep(0.05)
    return number
