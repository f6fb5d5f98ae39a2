"""Structure model that needs more than a tick for each target of the plate.

Between targets the plate moves on: predicted while the next target is awaited, corrected towards it
once it has arrived. Predictor and corrector are parabolas through the last targets, as in
event-driven hybrid tests (Mosqueda, Stojadinovic and Mahin, Earthquake Engineering and Structural
Dynamics 34 (2005) 1443). While a target is late, the plate is held and the ticks are counted. A
target that stays late ends the test.
"""

from __future__ import annotations

import math
import threading

from rigtwin.errors import RigtwinError

LATEST = 0.5
"""Largest delay of a target before the test ends, s."""


class LateModel(RigtwinError):
    """Error of a model that gave no target for too long."""


class SlowModel:
    """Structure whose positions come from another program, one every `ticks` ticks.

    Thread-safe: one thread moves the plate by `advance`, another gives targets and takes forces.

    Parameters
    ----------
    start
        Position of the plate at the start, m.
    ticks
        Ticks from one target to the next.
    waits
        Whether a tick waits for its target. A twin can wait; a real rig cannot.
    latest
        Largest delay of a target, s.
    """

    def __init__(
        self, start: float, ticks: int, *, waits: bool = False, latest: float = LATEST
    ) -> None:
        if not isinstance(ticks, int) or ticks < 1:
            raise RigtwinError(
                f"a target every {ticks!r:.40} ticks: expected a whole number from 1"
            )
        for name, value, low in (("start", start, -1e300), ("latest", latest, 0.0)):
            if not isinstance(value, int | float) or not low <= value < math.inf:
                least = "" if low < 0.0 else f" from {low:g}"
                raise RigtwinError(f"{name} = {value!r:.40}: expected a finite number{least}")
        self.late = 0
        """Number of ticks at which the plate was held for want of a target."""
        self._targets = [start, start, start]
        self._next: float | None = None
        self._felt: float | None = None
        self._ticks, self._waits, self._latest = ticks, waits, latest
        self._done, self._from, self._off = 0, 0, 0.0
        self._position, self._held = start, 0
        self._begun = self._over = False
        self._changed = threading.Condition()

    # The fast side

    def advance(self, force: float, period: float) -> float:
        """Return the plate's position at the next tick, m.

        Parameters
        ----------
        force
            Measured force at this tick, N.
        period
            Time from tick to tick, s.

        Raises
        ------
        LateModel
            If a target is late by more than `latest`.
        """
        # One lock for targets and forces: both threads see a consistent pair.
        with self._changed:
            self._felt = force
            self._changed.notify_all()
            missing = self._waits and not self._is_served()
            if missing and not self._changed.wait_for(self._is_served, self._latest):
                raise LateModel(f"the model gave no target within {self._latest:g} s")
            if self._next is None:
                self._predict(period)
            else:
                self._correct()
            return self._position

    def _is_served(self) -> bool:
        return self._next is not None or self._over

    def _predict(self, period: float) -> None:
        if self._over:
            return
        if self._done < self._ticks:
            self._done += 1
            self._position = _through(self._targets, 1.0 + self._done / self._ticks)
            return
        self.late += 1
        self._held += 1
        if self._held * period > self._latest:
            raise LateModel(f"the model gave no target for {self._latest:g} s; the plate is held")

    def _correct(self) -> None:
        assert self._next is not None
        way = [*self._targets[1:], self._next]
        if not self._begun:
            # A late target is approached within a quarter of the ticks, without a jump.
            self._done = min(self._done, self._ticks - max(1, self._ticks // 4))
            self._from, self._begun = self._done, True
            self._off = self._position - _through(way, self._done / self._ticks)
        self._done += 1
        remaining = (self._ticks - self._done) / max(self._ticks - self._from, 1)
        self._position = _through(way, self._done / self._ticks) + self._off * remaining
        if self._done < self._ticks:
            return
        self._targets, self._next = way, None
        self._done = self._from = self._held = 0
        self._begun = False
        self._changed.notify_all()

    # The slow side

    def give(self, target: float) -> bool:
        """Give the next target, m, once the last is reached; return False if the test ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._next is None or self._over)
            if self._over:
                return False
            self._next = target
            self._changed.notify_all()
            return True

    def take_force(self) -> float | None:
        """Return the force at the last target, N, once it is reached; None if the test ended."""
        with self._changed:
            self._changed.wait_for(
                lambda: (self._next is None and self._felt is not None) or self._over
            )
            return None if self._over else self._felt

    def end(self) -> None:
        """End the exchange of targets and forces; the plate stays where it is."""
        # Both threads may be waiting for the other: wake them.
        with self._changed:
            self._over = True
            self._changed.notify_all()


def _through(points: list[float], place: float) -> float:
    """Return the value at a place of the parabola through three points at −1, 0 and 1."""
    before, middle, ahead = points
    return (
        middle + 0.5 * place * (ahead - before) + 0.5 * place**2 * (ahead - 2.0 * middle + before)
    )
