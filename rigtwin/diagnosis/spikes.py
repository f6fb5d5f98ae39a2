"""Spikes of a residual where dry friction reverses a tick early or late."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

JUMPS = ("force", "command")
"""Kinds of signal that jump where dry friction reverses. Positions and velocities do not."""
SPIKE = 4.0
"""Height above its neighbours from which a sample is a spike, in units of the signal's noise."""


@kernel
def despike(signal: Array, height: float) -> None:
    """Replace spikes in place by the median of the seven samples about them.

    Parameters
    ----------
    signal
        Samples, shape (ticks,). The first and the last three are not changed.
    height
        Distance from the median above which a sample is a spike, in the signal's unit.
    """
    ticks = len(signal)
    if ticks < 7:
        return
    original = signal.copy()
    # A sample within `height` of three of its neighbours cannot be that far from the median of
    # seven. Counting these first avoids sorting at nearly every tick.
    close = np.zeros(ticks, np.int8)
    for away in (-3, -2, -1, 1, 2, 3):
        for tick in range(3, ticks - 3):
            close[tick] += np.int8(abs(original[tick + away] - original[tick]) <= height)
    window = np.empty(7)
    for tick in range(3, ticks - 3):
        if close[tick] >= 3:
            continue
        # The median is that of the original samples, so a replaced neighbour does not count.
        window[:] = original[tick - 3 : tick + 4]
        # Insertion sort of seven values: np.median would allocate at every tick.
        for place in range(1, 7):
            value = window[place]
            before_it = place - 1
            while before_it >= 0 and window[before_it] > value:
                window[before_it + 1] = window[before_it]
                before_it -= 1
            window[before_it + 1] = value
        if abs(original[tick] - window[3]) > height:
            signal[tick] = window[3]
