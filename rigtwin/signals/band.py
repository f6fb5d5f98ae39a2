"""Signals up to a frequency, without delay."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array

ORDER = 4
"""Of the Butterworth filter that goes over a signal forth and back."""
WHOLE = 0.8
"""Share of half the sampling frequency from which a band is the whole."""


def limit_band(signals: Array, band: float, period: float) -> Array:
    """Signals up to a frequency.

    Parameters
    ----------
    signals
        Shape (..., ticks).
    band
        Hz, where half of the amplitude is left; infinite for all of it.
    period
        s, of a tick.

    Returns
    -------
    array
        Of the same shape.
    """
    if band * 2.0 * period > WHOLE:
        return signals
    # Loading it takes a second, which most runs need not wait for.
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(
        sosfiltfilt(butter(ORDER, band, fs=1.0 / period, output="sos"), signals, axis=-1)
    )
