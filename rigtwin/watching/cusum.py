"""One-sided CUSUM test of a variance: detects when a signal has more power than expected.

Page's test (Biometrika 41, 1954) adds up the logarithm of the likelihood ratio of two normal
distributions: of the expected variance, and of `RATIO` times that variance. The mean time to a
false alarm is at least exp(limit) blocks (Lorden, Ann. Math. Stat. 42, 1971).
"""

from __future__ import annotations

import math

RATIO = 2.0
"""Variance ratio that the test is designed for. The sum grows for ratios above 1.39."""


class Cusum:
    """State of a test: its value, at least 0, and the time, in s, at which it last was 0."""

    def __init__(self, start: float) -> None:
        """Start a test at a time in s."""
        self.value, self.since = 0.0, start

    def add(self, power: float, count: float, time: float) -> float:
        """Add a block.

        Parameters
        ----------
        power
            Sum of `count` squares, each of mean 1 or less without a fault.
        count
            Number of independent squares in the sum; not necessarily whole.
        time
            End of the block, in s.

        Returns
        -------
        float
            Value after the block.
        """
        # log p₁/p₀ of n normal squares with variances 1 and R: ½ (1 − 1/R) Σx² − ½ n log R.
        step = 0.5 * (1.0 - 1.0 / RATIO) * power - 0.5 * count * math.log(RATIO)
        # Page's reset at zero: a long quiet time earns no credit against a later change.
        self.value = max(self.value + step, 0.0)
        # The last time at zero is the estimate of when the change began.
        if self.value == 0.0:
            self.since = time
        return self.value
