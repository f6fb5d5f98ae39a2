"""A model that takes longer than a tick, between whose targets the plate moves on: predicted while
the next target is awaited, corrected towards it once it is there.

Predictor and corrector are polynomials of second order through the last targets, as in event-driven
hybrid tests (Mosqueda, Stojadinovic and Mahin, Earthquake Engineering and Structural Dynamics 34
(2005) 1443). What is late holds the plate where it is, and is counted; what stays late ends the
test.
"""

from __future__ import annotations

import math
import threading

from rigtwin.errors import RigtwinError

LATEST = 0.5
"""s that a target may be late before the test is ended."""


class LateModel(RigtwinError):
    """A model that gave no target for too long."""


class SlowModel:
    """A structure whose positions come from elsewhere, one every `ticks` ticks.

    Thread-safe: one thread moves the plate by `advance`, another gives targets and takes forces.

    Parameters
    ----------
    start
        m, of the plate.
    ticks
        From one target to the next.
    waits
        Whether a tick waits for its target: a twin has time, a rig has not.
    latest
        s that a target may be late, in all of a wait.
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
        """Ticks that the plate was held because there was no target."""
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
        """Where the plate is at the next tick. Raises LateModel."""
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
            # One that comes late is made for in a quarter of the ticks.
            self._done = min(self._done, self._ticks - max(1, self._ticks // 4))
            self._from, self._begun = self._done, True
            self._off = self._position - _through(way, self._done / self._ticks)
        self._done += 1
        left = (self._ticks - self._done) / max(self._ticks - self._from, 1)
        self._position = _through(way, self._done / self._ticks) + self._off * left
        if self._done < self._ticks:
            return
        self._targets, self._next = way, None
        self._done = self._from = self._held = 0
        self._begun = False
        self._changed.notify_all()

    # The slow side

    def give(self, target: float) -> bool:
        """Gives the next target, m, once the one before is reached; False if the test is over."""
        with self._changed:
            self._changed.wait_for(lambda: self._next is None or self._over)
            if self._over:
                return False
            self._next = target
            self._changed.notify_all()
            return True

    def take_force(self) -> float | None:
        """The force at the last target, N, once it is reached; None if the test is over."""
        with self._changed:
            self._changed.wait_for(
                lambda: (self._next is None and self._felt is not None) or self._over
            )
            return None if self._over else self._felt

    def end(self) -> None:
        """No more targets come, or none are wanted: the plate stays where it is."""
        with self._changed:
            self._over = True
            self._changed.notify_all()


def _through(points: list[float], place: float) -> float:
    """Of a parabola through three points at −1, 0 and 1."""
    before, here, ahead = points
    return here + 0.5 * place * (ahead - before) + 0.5 * place**2 * (ahead - 2.0 * here + before)
