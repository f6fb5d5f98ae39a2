"""A one-sided CUSUM of a variance: when has a signal more power than it should have?

Page's test (Biometrika 41, 1954) on the logarithm of the likelihood ratio of two normal
distributions, of the variance that is explained and of `RATIO` times as much. Its mean time to a
false alarm is at least exp(limit) blocks (Lorden, Ann. Math. Stat. 42, 1971).
"""

from __future__ import annotations

import math

RATIO = 2.0
"""Times the power that is explained: what the test is made for. It adds up from 1.39 times on."""


class Cusum:
    """One of them. value: 0 or above; since: time at which it last was 0, s."""

    def __init__(self, start: float) -> None:
        """start: s."""
        self.value, self.since = 0.0, start

    def add(self, power: float, count: float, time: float) -> float:
        """Takes a block.

        Parameters
        ----------
        power
            Sum of `count` squares, each of mean 1 or less if nothing is wrong.
        count
            Independent ones among them, need not be whole.
        time
            s, at the block's end.

        Returns
        -------
        float
            The value with it.
        """
        step = 0.5 * (1.0 - 1.0 / RATIO) * power - 0.5 * count * math.log(RATIO)
        self.value = max(self.value + step, 0.0)
        if self.value == 0.0:
            self.since = time
        return self.value
