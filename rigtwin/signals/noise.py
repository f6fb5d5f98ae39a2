"""Noise estimated from data: the white part of a signal, and the mains line."""

from __future__ import annotations

import math

import numpy as np

from rigtwin.numerics.arrays import Array

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the magnitude of a standard normal variable."""
MAINS_SEARCH = 0.5
"""Distance from the nominal mains frequency within which the line is searched, in Hz."""
REST, STILL = 0.1, 6.0
"""Duration of a rest, in s, and the range of a motion, in its errors, that counts as rest."""


SWITCHED = 4
"""Largest number of values of a switched signal, whose steps do not show a converter's bits."""


def white_noise(signal: Array) -> float:
    """Return the standard deviation of a signal's white noise.

    Third differences remove smooth motion, and 97 % of a 50 Hz line at 1 kHz. Their median ignores
    the jumps of dry friction. For white noise Var(Δ³) = (1 + 9 + 9 + 1) σ² = 20 σ². If coarse bits
    make most differences zero, their RMS is used. A switched signal has no noise.
    """
    third = np.diff(signal, 3)
    if _is_switched(signal):
        return 0.0
    typical = float(np.median(np.abs(third))) / NORMAL_MEDIAN
    return (typical or rms(third)) / math.sqrt(20.0)


def _is_switched(signal: Array) -> bool:
    """Return whether a signal has only a few values, as a relay's; a constant signal does not."""
    # The first samples of most signals show at once that there are more values.
    start = signal[: 64 * SWITCHED]
    return len(np.unique(start)) <= SWITCHED and 1 < len(np.unique(signal)) <= SWITCHED


def smallest_step(signal: Array) -> float:
    """Return the step of one bit: the smallest difference of two values; 0 without a step.

    Differences within rounding are ignored.
    """
    values = np.unique(signal)
    if len(values) <= SWITCHED:
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * max(float(np.ptp(signal)), 1e-300)]
    if not len(steps):
        return 0.0
    bit = float(np.min(steps))
    # On a lattice every difference is a whole number of bits.
    share = np.abs(steps / bit - np.round(steps / bit))
    return bit if float(np.mean(share < 0.02)) > 0.9 else 0.0


def rms(signal: Array) -> float:
    """Return the root mean square, mean included."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(signal**2)))


def remove_mains(signal: Array, period: float, frequency: float) -> Array:
    """Remove the mains line from a signal; the mean stays.

    Parameters
    ----------
    signal : Array
        Signal, shape (ticks,).
    period : float
        Period of a tick, in s.
    frequency : float
        Nominal mains frequency, in Hz. The line is searched within ±0.5 Hz.

    Returns
    -------
    Array
        Signal without the line, shape (ticks,). A signal sampled too slowly to show the line is
        returned unchanged: at 50 samples a second the line is a constant.
    """
    if frequency + MAINS_SEARCH >= 0.5 / period:
        return signal.copy()
    count = len(signal)
    time = np.arange(count) * period
    centred = signal - np.mean(signal)
    window = np.hanning(count)
    grid = np.fft.rfftfreq(count, period)
    near = np.abs(grid - frequency) <= MAINS_SEARCH
    # Too short a signal cannot resolve the line's frequency: the nominal one is used.
    if near.sum() < 3:
        return _remove_line(signal, centred, window, time, frequency)
    peak = grid[near][np.argmax(np.abs(np.fft.rfft(window * centred))[near])]
    width = grid[1]

    # The line is narrower than the grid: the windowed transform is maximised between its points.
    def power(candidate: float) -> float:
        return -abs(np.sum(window * centred * np.exp(-2j * math.pi * candidate * time)))

    # scipy's modules are imported where they are needed, because they take long to load.
    from scipy.optimize import minimize_scalar

    line = minimize_scalar(
        power,
        bounds=(peak - width, peak + width),
        method="bounded",
        options={"xatol": width * 1e-3},
    )
    return _remove_line(signal, centred, window, time, float(line.x))


def _remove_line(
    signal: Array, centred: Array, window: Array, time: Array, frequency: float
) -> Array:
    # Least squares with a window, so that motion at the signal's ends does not leak into the line.
    basis = np.column_stack(
        [np.cos(2 * math.pi * frequency * time), np.sin(2 * math.pi * frequency * time)]
    )
    weights, *_ = np.linalg.lstsq(window[:, None] * basis, window * centred, rcond=None)
    return signal - basis @ weights


def spectrum(signal: Array, period: float) -> tuple[Array, Array]:
    """Return the one-sided power spectral density: frequencies in Hz, density in unit²/Hz."""
    # scipy.signal takes half a second to load, which most commands need not wait for.
    from scipy.signal import welch

    return welch(signal, 1.0 / period, nperseg=min(4096, len(signal)), detrend=False)  # type: ignore[arg-type]


def band(signal: Array, period: float) -> tuple[float, float]:
    """Return the band in Hz with the middle 80 % of the signal's power, mean included.

    (0, 0) for a signal that is zero.
    """
    frequencies, density = spectrum(signal, period)
    if not density.any():
        return 0.0, 0.0
    share = np.cumsum(density) / np.sum(density)
    low, high = np.searchsorted(share, [0.1, 0.9])
    return float(frequencies[low]), float(frequencies[high])
