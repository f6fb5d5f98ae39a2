"""A delay line: a ring of past samples, read between two of them."""

from __future__ import annotations

import numpy as np

from controllers.compiled import compilable
from rigtwin.numerics.arrays import Array


def ring(delay: float, value: float) -> Array:
    """A ring long enough for `delay` (in samples), filled with `value`."""
    return np.full(int(delay) + 3, value)


@compilable
def delay_sample(history: Array, memory: Array, delay: float, sample: float) -> float:
    """Takes a sample and returns the one `delay` samples ago, straight between neighbours.

    memory[0]: place in the ring.
    """
    length = len(history)
    place = int(memory[0])
    history[place] = sample
    memory[0] = (place + 1) % length
    whole = int(delay)
    part = delay - whole
    return (1.0 - part) * history[(place - whole) % length] + part * history[
        (place - whole - 1) % length
    ]
