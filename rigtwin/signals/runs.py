"""Runs of equal samples, by which a dead or cut-off sensor is known."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import smallest_step, white_noise

FLAT = 8
"""Equal samples in a row at a signal's very end of range: it is cut off there."""


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


def find_cut_off(signal: Array) -> np.ndarray:
    """Finds where a sensor is cut off at an end of its range, shape (ticks,)."""
    found = np.zeros(len(signal), bool)
    if white_noise(signal) >= smallest_step(signal):
        # Bits coarser than the noise stand still at rest too.
        for extreme in (signal.min(), signal.max()):
            at_end = signal == extreme
            if longest_run(signal, at_end)[1] >= FLAT:
                found |= at_end
    return found
