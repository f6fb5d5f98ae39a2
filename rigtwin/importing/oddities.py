"""What people should look at in a signal before they believe it."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.runs import runs_at_ends

OUTLIER = 100.0
"""Times the range of nearly all of a signal at which a sample is damage."""


COUNTERS = tuple(2.0**bits for bits in (8, 10, 12, 14, 16, 20, 24, 32))
"""After how many counts counters begin again."""


def looks_wrapped(counts: Array) -> float | None:
    """After how many counts a column seems to begin again.

    Parameters
    ----------
    counts
        As the file has them, shape (rows,).

    Returns
    -------
    float or None
        None if it does not seem to.
    """
    known = counts[np.isfinite(counts)]
    if len(known) < 2:
        return None
    step, reach = float(np.max(np.abs(np.diff(known)))), float(np.ptp(known))
    for wrap in COUNTERS:
        if 0.98 * wrap <= reach <= wrap and step > 0.9 * wrap:
            return wrap
    return None


def find_oddities(values: Array, time: Array) -> list[str]:
    """What is odd in a channel, a line each: nothing moves, damage, a converter's end of range.

    Parameters
    ----------
    values, time
        Shape (ticks,).
    """
    if np.ptp(values) == 0.0:
        return [f"is {values[0]:g} throughout"]
    found = []
    spread = float(np.subtract(*np.quantile(values, [0.999, 0.001])))
    far = np.abs(values - np.median(values))
    if spread > 0.0 and far.max() > OUTLIER * spread:
        found.append(
            f"is {values[np.argmax(far)]:.4g} at {time[np.argmax(far)]:.4g} s, "
            "far outside of all else"
        )
    ends = {float(values[start]): start for start, _ in reversed(runs_at_ends(values))}
    for extreme, start in ends.items():
        side = "above" if extreme == values.max() else "below"
        share = 100.0 * float(np.mean(values == extreme))
        found.append(
            f"is cut off {side} {extreme:.6g} ({share:.2g} % of the ticks), "
            f"first at {time[start]:.4g} s"
        )
    return found
