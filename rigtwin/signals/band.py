"""Band limitation of signals without delay."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rigtwin.numerics.arrays import Array

ORDER = 4
"""Order of the Butterworth filter, which is applied forwards and backwards."""
WHOLE = 0.8
"""Share of the Nyquist frequency from which a band counts as unlimited."""


def limit_band(signals: Array, band: float, period: float) -> Array:
    """Return signals limited to a band.

    Parameters
    ----------
    signals
        Signals, shape (..., ticks).
    band
        Frequency in Hz at which half of the amplitude remains; infinite for no limit.
    period
        Period of a tick, in s.

    Returns
    -------
    array
        Limited signals of the same shape.
    """
    if band * 2.0 * period > WHOLE:
        return signals
    # scipy.signal takes a second to load, which most commands need not wait for.
    from scipy.signal import sosfiltfilt

    return np.asarray(sosfiltfilt(_design_filter(band, period), signals, axis=-1))


@lru_cache(maxsize=16)
def _design_filter(band: float, period: float) -> Array:
    """Return the second-order sections of the filter, shape (sections, 6).

    A design takes as long as filtering 10 s of a signal at 500 Hz, so that it is kept.
    """
    from scipy.signal import butter

    return np.asarray(butter(ORDER, band, fs=1.0 / period, output="sos"))
