"""Delay line: a ring buffer of past samples, interpolated between two of them."""

from __future__ import annotations

import numpy as np

from controllers.compiled import compilable
from rigtwin.numerics.arrays import Array


def ring(delay: float, value: float) -> Array:
    """Return a ring buffer for a delay in samples, filled with a value."""
    return np.full(int(delay) + 3, value)


@compilable
def delay_sample(history: Array, memory: Array, delay: float, sample: float) -> float:
    """Store a sample, and return the one `delay` samples ago, by linear interpolation.

    `memory[0]` is the index of the next sample in the ring.
    """
    # The ring is three samples longer than the delay: the present one, and both neighbours.
    length = len(history)
    place = int(memory[0])
    history[place] = sample
    memory[0] = (place + 1) % length
    whole = int(delay)
    part = delay - whole
    return (1.0 - part) * history[(place - whole) % length] + part * history[
        (place - whole - 1) % length
    ]
