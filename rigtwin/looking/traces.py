"""Traces as they are drawn: never more points than a screen shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.numerics.arrays import Array

BUCKETS = 400
"""Stretches of time of which the least and the largest value are drawn."""


def thin(time: Array, traces: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Traces with no more than 2 · `BUCKETS` points, all peaks kept.

    Parameters
    ----------
    time
        s, rising, shape (ticks,), one tick or more.
    traces
        Each of shape (ticks,).

    Returns
    -------
    tuple of Array and list of Array
        Times and traces, of one length. Where points had to be left out, each two are the least and
        the largest value of a stretch.
    """
    if len(time) <= 2 * BUCKETS:
        return time, list(traces)
    edges = np.linspace(0, len(time), BUCKETS + 1).astype(int)
    starts, middles = edges[:-1], (edges[:-1] + edges[1:]) // 2
    times = np.column_stack([time[starts], time[middles]]).ravel()
    found = []
    for trace in traces:
        least, largest = np.minimum.reduceat(trace, starts), np.maximum.reduceat(trace, starts)
        found.append(np.column_stack([least, largest]).ravel())
    return times, found


def mark(time: Array, traces: Sequence[Array], now: float) -> tuple[Array, ...]:
    """Traces with an upright line at a time.

    Parameters
    ----------
    time
        s, rising, shape (points,).
    traces
        Each of shape (points,), one or more.
    now
        s, where the line is.

    Returns
    -------
    tuple of Array
        Times, the traces, and the line as one more trace, which lies at the lowest value of all but
        for `now`, where it goes to the highest and back.
    """
    place = int(np.searchsorted(time, now))
    low = min(float(np.min(trace)) for trace in traces)
    high = max(float(np.max(trace)) for trace in traces)
    times = np.insert(time, place, [now, now, now])
    found = [np.insert(trace, place, [np.interp(now, time, trace)] * 3) for trace in traces]
    line = np.full(len(times), low)
    line[place + 1] = high
    return (times, *found, line)
