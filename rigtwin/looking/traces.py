"""Traces reduced to the number of points that a screen can show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.numerics.arrays import Array

BUCKETS = 400
"""Number of stretches of which the smallest and the largest value are drawn."""


def thin(time: Array, traces: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Reduce traces to at most 2 · `BUCKETS` points, with all peaks preserved.

    Parameters
    ----------
    time
        Times in s, ascending, shape (ticks,), with at least one tick.
    traces
        Traces, each of shape (ticks,).

    Returns
    -------
    tuple of Array and list of Array
        Times and traces of equal length. Each pair of points is the minimum and the maximum of a
        stretch, if points had to be left out.
    """
    if len(time) <= 2 * BUCKETS:
        return time, list(traces)
    # Equal stretches by ticks; both extremes of each are drawn, in no particular order within it.
    edges = np.linspace(0, len(time), BUCKETS + 1).astype(int)
    starts, middles = edges[:-1], (edges[:-1] + edges[1:]) // 2
    times = np.column_stack([time[starts], time[middles]]).ravel()
    reduced = []
    for trace in traces:
        least, largest = np.minimum.reduceat(trace, starts), np.maximum.reduceat(trace, starts)
        reduced.append(np.column_stack([least, largest]).ravel())
    return times, reduced


def mark(time: Array, traces: Sequence[Array], now: float) -> tuple[Array, ...]:
    """Add a vertical line at a time to traces.

    Parameters
    ----------
    time
        Times in s, ascending, shape (points,).
    traces
        One or more traces, each of shape (points,).
    now
        Time of the line, in s.

    Returns
    -------
    tuple of Array
        Times, traces, and the line as a further trace. It lies at the lowest value of all traces,
        and rises to the highest at `now`.
    """
    # The line is inserted at its place in time, because a plot's times must ascend.
    place = int(np.searchsorted(time, now))
    low = min(float(np.min(trace)) for trace in traces)
    high = max(float(np.max(trace)) for trace in traces)
    # Three points at the same time let one trace go up and down vertically.
    times = np.insert(time, place, [now, now, now])
    marked = [np.insert(trace, place, [np.interp(now, time, trace)] * 3) for trace in traces]
    line = np.full(len(times), low)
    line[place + 1] = high
    return (times, *marked, line)
