"""Real time.

Deadlines that do not drift, what the system grants a loop that must meet them, and how late it
was.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.system import (
    RESOLUTION,
    count_cores,
    lock_memory,
    lower_priority,
    monotonic,
    raise_priority,
    unlock_memory,
)
from rigtwin.system.grant import SCHEDULING, Grant

SPIN = 200e-6
"""s before a deadline from which the loop spins: the kernel's sleep ends later than asked for by
tens of microseconds."""
PRIORITY = 80
EDGES = tuple(
    1e-6 * value
    for value in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)
)
"""Upper edges of the lateness histogram, s; the last class is what is beyond."""


def sleep_until(deadline: float, spin: float = SPIN) -> None:
    """Returns at a time of `monotonic`, spinning over the last `spin` seconds."""
    remaining = deadline - monotonic() - spin
    if remaining > 0.0:
        time.sleep(remaining)
    while monotonic() < deadline:
        pass


class Pacer:
    """Ticks at absolute deadlines, so that a late one does not shift those after it.

    late: s by which the last wait ended after its deadline. A tick that ends after the next
    deadline is missed, and the loop goes on with the first one that is still ahead.
    """

    def __init__(self, period: float) -> None:
        self.period, self.late, self._next = period, 0.0, 0.0

    def wait(self) -> int:
        """Waits for the next deadline that is not past; returns how many were missed."""
        now = monotonic()
        if self._next == 0.0:
            self._next = now
        behind = int((now - self._next) / self.period) if now > self._next else 0
        self._next += behind * self.period
        if behind == 0:
            sleep_until(self._next)
        self.late = monotonic() - self._next
        self._next += self.period
        return behind


class Lateness:
    """How late each tick was, and how long its work took, both in s."""

    def __init__(self, ticks: int) -> None:
        self._late, self._work, self._count, self.missed = np.zeros(ticks), np.zeros(ticks), 0, 0

    def add(self, late: float, work: float) -> None:
        if self._count < len(self._late):
            self._late[self._count], self._work[self._count] = late, work
            self._count += 1

    def record(self, scheduling: str) -> dict[str, str]:
        """What a recording keeps.

        The histogram (upper edges in s, ticks in each class), median, 99.9th percentile and
        maximum of both, ticks missed, and what the system granted.
        """
        figures = {"missed": str(self.missed), "scheduling": scheduling, "ticks": str(self._count)}
        for name, values in (
            ("late", self._late[: self._count]),
            ("work", self._work[: self._count]),
        ):
            if len(values):
                figures |= {
                    f"{name}_{key}": f"{value:.3e}" for key, value in _statistics(values).items()
                }
        counts, _ = np.histogram(self._late[: self._count], bins=[-np.inf, *EDGES, np.inf])
        figures["histogram"] = json.dumps({"edges": EDGES, "counts": counts.tolist()})
        return figures


def _statistics(values: Array) -> dict[str, float]:
    return {
        "median": float(np.median(values)),
        "999": float(np.percentile(values, 99.9)),
        "max": float(values.max()),
    }


@contextmanager
def in_real_time(fifo: bool = True) -> Iterator[tuple[Grant, ...]]:
    """Takes what the system permits for the time of the loop, and gives it back.

    FIFO scheduling, memory locked, no garbage collection.

    Parameters
    ----------
    fifo : bool
        Whether to ask for the scheduling class at all.

    Yields
    ------
    tuple of Grant
        What was granted and what not.
    """
    grants = [lock_memory(), Grant("no garbage collection")]
    collecting, interval = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    gc.disable()
    gc.freeze()
    sys.setswitchinterval(1e-4)
    before = raise_priority(PRIORITY) if fifo else Grant(SCHEDULING, "not asked for")
    grants.append(before)
    try:
        yield tuple(grants)
    finally:
        if fifo and not before.lacking:
            lower_priority()
        sys.setswitchinterval(interval)
        gc.unfreeze()
        if collecting:
            gc.enable()
        if not grants[0].lacking:
            unlock_memory()


def list_shortcomings() -> list[str]:
    """What this computer lacks for a loop in real time, a line each; changes nothing."""
    lacks: list[str] = []
    with in_real_time() as grants:
        lacks += [f"{grant.name}: {grant.lacking}" for grant in grants if grant.lacking]
    if count_cores() < 2:
        lacks.append(
            "a core of its own: this computer has one, the loop shares it with everything else"
        )
    if RESOLUTION > 1e-6:
        lacks.append(f"a fine clock: its resolution is {RESOLUTION:g} s; expected 1 us or better")
    return lacks


def describe_grants(grants: tuple[Grant, ...]) -> str:
    return "; ".join(f"{grant.name}: {grant.lacking or 'granted'}" for grant in grants)
