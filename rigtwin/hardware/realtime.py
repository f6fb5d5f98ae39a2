"""Real time: deadlines without drift, privileges granted by the system, and lateness statistics."""

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
"""Time before a deadline from which the loop spins, in s. The kernel ends a sleep tens of
microseconds late."""
PRIORITY = 80
"""FIFO priority of the loop: above the kernel's interrupt threads, which have 50 by default."""
EDGES = tuple(
    1e-6 * value
    for value in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)
)
"""Upper edges of the classes of the lateness histogram, in s. The last class has no upper edge."""


def sleep_until(deadline: float, spin: float = SPIN) -> None:
    """Return at a time of `monotonic`, after spinning over the last `spin` seconds."""
    remaining = deadline - monotonic() - spin
    if remaining > 0.0:
        time.sleep(remaining)
    while monotonic() < deadline:
        pass


class Pacer:
    """Ticks at absolute deadlines, so that a late tick does not delay the ones after it.

    A tick that ends after the next deadline is missed. The loop then continues with the first
    deadline that lies ahead.

    Attributes
    ----------
    late
        Time by which the last wait ended after its deadline, in s.
    """

    def __init__(self, period: float) -> None:
        self.period, self.late, self._next = period, 0.0, 0.0

    def wait(self) -> int:
        """Wait for the next deadline that lies ahead; return the number of missed deadlines."""
        now = monotonic()
        if self._next == 0.0:
            self._next = now
        # Deadlines that have passed are skipped, so that ticks stay on the original grid.
        # A deadline that has just passed is merely late and is used; a whole period later it is
        # missed.
        behind = int((now - self._next) / self.period) if now > self._next else 0
        self._next += behind * self.period
        if behind == 0:
            sleep_until(self._next)
        self.late = monotonic() - self._next
        self._next += self.period
        return behind


class Lateness:
    """Lateness of each tick, and duration of its work, in s."""

    def __init__(self, ticks: int) -> None:
        self._late, self._work, self._count, self.missed = np.zeros(ticks), np.zeros(ticks), 0, 0

    def add(self, late: float, work: float) -> None:
        """Add a tick. Arrays are allocated beforehand, so that no tick waits for memory."""
        if self._count < len(self._late):
            self._late[self._count], self._work[self._count] = late, work
            self._count += 1

    def record(self, scheduling: str) -> dict[str, str]:
        """Return the statistics as a recording stores them.

        They are the histogram (upper edges in s, ticks per class), median, 99.9th percentile and
        maximum of lateness and work, the number of missed ticks, and the system's grants.
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
        # A histogram keeps rare delays that a mean or a percentile would hide.
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
    """Run a loop with the privileges that the system grants, and return them afterwards.

    The privileges are FIFO scheduling, locked memory, and no garbage collection.
    Parameters
    ----------
    fifo : bool
        Whether to request FIFO scheduling.

    Yields
    ------
    tuple of Grant
        Result of each request.
    """
    grants = [lock_memory(), Grant("no garbage collection")]
    collecting, interval = gc.isenabled(), sys.getswitchinterval()
    # Frozen objects are never scanned again, so that a collection after the loop is short.
    gc.collect()
    gc.disable()
    gc.freeze()
    # Other Python threads must give the interpreter back within 0.1 ms instead of 5 ms.
    sys.setswitchinterval(1e-4)
    # Priority is the last request: everything before it may take its time.
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
    """Return what this computer lacks for a loop in real time, one per line. Nothing is changed."""
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
    """Return the grants in one line."""
    return "; ".join(f"{grant.name}: {grant.lacking or 'granted'}" for grant in grants)
