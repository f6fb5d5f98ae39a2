"""Runs of equal samples, which reveal a dead or clipped sensor."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import smallest_step, white_noise

FLAT = 8
"""Number of equal samples in a row at an end of a signal's range that count as clipped."""
BEFORE, SLOWED = 9, 0.55
"""Number of samples before such a run, and the smallest share of their mean speed that the last of
them may have. A sine clipped for that long has 0.65; a motion that comes to rest has 0.45."""
STAIR, STAIRS = 3, 0.25
"""Number of equal samples in a row beside a run, and their share of the run's length, from which
the signal counts as moving in stairs."""


def longest_run(signal: Array, counted: Array | np.ndarray) -> tuple[int, int]:
    """Return the longest run of equal samples.

    Parameters
    ----------
    signal : Array
        Signal, shape (ticks,).
    counted : Array
        Whether each sample counts, shape (ticks,).

    Returns
    -------
    tuple of int
        Start and length of the run.
    """
    equal = (np.diff(signal) == 0.0) & counted[1:] & counted[:-1]
    edges = np.diff(np.concatenate([[0], equal.astype(np.int8), [0]]))
    starts, ends = np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0]
    if not len(starts):
        return 0, 1
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest] - starts[longest]) + 1


def runs_at_ends(signal: Array) -> list[tuple[int, int]]:
    """Return where a signal runs into an end of its range and stays there.

    Zero is no end of a range, because a motor that is switched off may stay there. Signals that
    come to rest by themselves are left out: they slow down before, or repeat values beside the run,
    as a signal with coarse bits does.

    Parameters
    ----------
    signal : Array
        Signal, shape (ticks,).

    Returns
    -------
    list of (int, int)
        Start of each run, and the sample after its end.
    """
    runs = []
    for extreme in (signal.max(), signal.min()):
        if extreme == 0.0:
            continue
        edges = np.diff(np.concatenate([[0], (signal == extreme).astype(np.int8), [0]]))
        starts, stops = np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0]
        runs += [
            (int(start), int(stop))
            for start, stop in zip(starts, stops, strict=True)
            if stop - start >= FLAT and _is_run_into(signal, int(start), int(stop))
        ]
    return runs


def _is_run_into(signal: Array, start: int, stop: int) -> bool:
    """Return whether the signal before and beside a run moves as if it went on beyond."""
    # Too little lies before the run to tell how the signal reached it.
    if start < BEFORE:
        return False
    before = signal[start - BEFORE : start]
    speed, last = abs(before[-1] - before[0]) / (BEFORE - 1), abs(before[-1] - before[-3]) / 2.0
    if last < SLOWED * speed or speed == 0.0:
        return False
    length = stop - start
    beside = (signal[max(start - length, 0) : start], signal[stop : stop + length])
    longest = max(
        (longest_run(part, np.ones(len(part), bool))[1] for part in beside if len(part)), default=1
    )
    return longest < max(STAIR, STAIRS * length)


def find_cut_off(signal: Array) -> np.ndarray:
    """Return where a sensor is clipped at an end of its range, shape (ticks,)."""
    clipped = np.zeros(len(signal), bool)
    if white_noise(signal) >= smallest_step(signal):
        # With bits coarser than the noise, equal samples mean nothing.
        for start, _ in runs_at_ends(signal):
            clipped |= signal == signal[start]
    return clipped
