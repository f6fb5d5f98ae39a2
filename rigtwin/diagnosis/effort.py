"""Effort of a search: estimated processor time of its predictions, and how much it may spend."""

from __future__ import annotations

import math


class Effort:
    """Account of what predictions cost. Threads may add to it at the same time.

    Parameters
    ----------
    limit
        Estimated processor time after which no further hypothesis is tried, s.
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        # `list.append` is atomic, which `+=` is not.
        self._spent: list[float] = []

    def add(self, seconds: float) -> None:
        """Add the estimated processor time of a prediction, s."""
        self._spent.append(seconds)

    @property
    def share(self) -> float:
        """Share of the limit that is spent; above 1 beyond it."""
        # An exact sum does not depend on the order in which the threads added to it.
        return math.fsum(self._spent) / self.limit
