"""Runs of equal samples, by which a dead or cut-off sensor is known."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import smallest_step, white_noise

FLAT = 8
"""Equal samples in a row at a signal's very end of range: it is cut off there."""
BEFORE, SLOWED = 9, 0.55
"""Samples before such a stretch, and the share of their mean speed that the last ones have at
least: a sine that is cut off for that long has 0.65, what comes to rest 0.45."""
STAIR, STAIRS = 3, 0.25
"""Equal samples in a row beside a stretch, and their share of its length, with which the signal
moves by stairs."""


def longest_run(signal: Array, counted: Array | np.ndarray) -> tuple[int, int]:
    """Finds the longest run of equal samples.

    Parameters
    ----------
    signal : Array
        Shape (ticks,).
    counted : Array
        Which samples count, shape (ticks,).

    Returns
    -------
    tuple of int
        Where it starts, and its length.
    """
    same = (np.diff(signal) == 0.0) & counted[1:] & counted[:-1]
    edges = np.diff(np.concatenate([[0], same.astype(np.int8), [0]]))
    starts, ends = np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0]
    if not len(starts):
        return 0, 1
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest] - starts[longest]) + 1


def runs_at_ends(signal: Array) -> list[tuple[int, int]]:
    """Finds where a signal runs into an end of its range and stays there.

    Zero is no end of a range: a motor that is switched off gives nothing for as long as it likes.
    What comes to rest there by itself is none of it: it slows down before, or stands still at
    other values beside it, as bits do.

    Parameters
    ----------
    signal : Array
        Shape (ticks,).

    Returns
    -------
    list of (int, int)
        Where each begins, and where the signal leaves it.
    """
    found = []
    for extreme in (signal.max(), signal.min()):
        if extreme == 0.0:
            continue
        edges = np.diff(np.concatenate([[0], (signal == extreme).astype(np.int8), [0]]))
        starts, stops = np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0]
        found += [
            (int(start), int(stop))
            for start, stop in zip(starts, stops, strict=True)
            if stop - start >= FLAT and _is_run_into(signal, int(start), int(stop))
        ]
    return found


def _is_run_into(signal: Array, start: int, stop: int) -> bool:
    """Whether what lies before and beside a stretch moves on as if it were not there."""
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
    """Finds where a sensor is cut off at an end of its range, shape (ticks,)."""
    found = np.zeros(len(signal), bool)
    if white_noise(signal) >= smallest_step(signal):
        # Bits coarser than the noise stand still at rest too.
        for start, _ in runs_at_ends(signal):
            found |= signal == signal[start]
    return found
