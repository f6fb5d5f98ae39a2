"""Rows of a score, with intervals of their shares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class ScoreRow:
    """One measure of a score.

    Attributes
    ----------
    measure, value, goal : str
        Name, value and goal, as printed.
    low, high : float, optional
        95 % Wilson interval of a share. None for other values.
    """

    measure: str
    value: str
    goal: str
    low: float | None = None
    high: float | None = None


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % score interval of a share (Wilson, JASA 22 (1927) 209)."""
    # Without a case the share is unknown.
    if count == 0:
        return 0.0, 1.0
    # z is the 97.5 % quantile of the normal distribution.
    z, share = 1.959964, hits / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * math.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return middle - half, middle + half


def share_of(measure: str, hits: Sequence[bool], goal: str) -> ScoreRow:
    """Return the row of a share, with its interval."""
    if not len(hits):
        return ScoreRow(measure, "no case", goal)
    low, high = wilson(sum(hits), len(hits))
    return ScoreRow(
        measure,
        f"{sum(hits)} of {len(hits)} ({100 * sum(hits) / len(hits):.1f} %)",
        goal,
        low,
        high,
    )
