"""Filters of whole signals."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array


def low_pass(signal: Array, time_constant: float, period: float) -> Array:
    """Filter a signal by a first-order lag, T·y' = u − y, that starts settled.

    Parameters
    ----------
    signal
        Signal u, shape (ticks,).
    time_constant
        Time constant T, s.
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        Filtered signal y, shape (ticks,).
    """
    # Implicit Euler: stable for any time constant.
    share = period / (time_constant + period)
    start = [(1.0 - share) * signal[0]]
    from scipy.signal import lfilter  # Imported late: scipy is slow to load.

    out, _ = lfilter([share], [1.0, share - 1.0], signal, zi=start)
    return np.asarray(out)
