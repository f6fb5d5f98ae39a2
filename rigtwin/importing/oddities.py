"""Irregularities of a signal that a person should check before using it."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.runs import runs_at_ends

OUTLIER = 100.0
"""Distance from the median, in ranges of 99.8 % of the signal, above which a sample is damaged."""


COUNTERS = tuple(2.0**bits for bits in (8, 10, 12, 14, 16, 20, 24, 32))
"""Usual ranges of counters, counts."""


def looks_wrapped(counts: Array) -> float | None:
    """Return the range of the counter that a column seems to hold.

    Parameters
    ----------
    counts
        Column as the file states it, shape (rows,).

    Returns
    -------
    float or None
        Range, counts; None if the column does not seem to hold a counter that wraps.
    """
    known = counts[np.isfinite(counts)]
    if len(known) < 2:
        return None
    step, reach = float(np.max(np.abs(np.diff(known)))), float(np.ptp(known))
    # Nearly the whole range is covered, and one step crosses nearly all of it.
    for wrap in COUNTERS:
        if 0.98 * wrap <= reach <= wrap and step > 0.9 * wrap:
            return wrap
    return None


def find_oddities(values: Array, time: Array) -> list[str]:
    """Return the irregularities of a channel: no motion, damaged samples, a saturated converter.

    Parameters
    ----------
    values
        Values of the channel, shape (ticks,).
    time
        Time of the ticks, s, shape (ticks,).
    """
    if np.ptp(values) == 0.0:
        return [f"is {values[0]:g} throughout"]
    oddities = []
    # Quantiles rather than extremes, since the outlier itself must not widen the spread.
    spread = float(np.subtract(*np.quantile(values, [0.999, 0.001])))
    far = np.abs(values - np.median(values))
    if spread > 0.0 and far.max() > OUTLIER * spread:
        oddities.append(
            f"is {values[np.argmax(far)]:.4g} at {time[np.argmax(far)]:.4g} s, "
            "far outside of all else"
        )
    # Reversed, so that the first run at each end remains in the dictionary.
    ends = {float(values[start]): start for start, _ in reversed(runs_at_ends(values))}
    for extreme, start in ends.items():
        side = "above" if extreme == values.max() else "below"
        share = 100.0 * float(np.mean(values == extreme))
        oddities.append(
            f"is cut off {side} {extreme:.6g} ({share:.2g} % of the ticks), "
            f"first at {time[start]:.4g} s"
        )
    return oddities
