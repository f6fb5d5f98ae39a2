"""Motion estimated from noisy samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import REST, STILL, remove_mains, spectrum, white_noise

STANDS_OUT = 1.5
"""Ratio of a spectrum to the noise's from which it counts as motion."""
PADDING = 1000
"""Number of samples by which a signal is extended at both ends before filtering."""
HIGHEST_MOTION = 200.0
"""Highest frequency of measurable motion, in Hz, of plates and carriages of such a rig."""


@dataclass(frozen=True)
class EstimatedMotion:
    """Motion estimated beneath a noisy measurement.

    Parameters
    ----------
    position : Array
        Estimated motion, shape (ticks,).
    correction : Array
        Deviation of the motion from the expectation, shape (ticks,).
    velocity_error : float
        Standard deviation of the error of its rate of change, in unit/s.
    """

    position: Array
    correction: Array
    velocity_error: float


def estimate_motion(
    measured: Array, expected: Array, period: float, mains: float
) -> EstimatedMotion:
    """Estimate the motion beneath a noisy measurement, given a model's expectation.

    Where measured − expected is noise, the expectation plus a constant offset is the better
    estimate. What exceeds the noise passes a Wiener filter with the gain 1 − noise/spectrum, the
    linear filter with the smallest error in position and in velocity.

    Parameters
    ----------
    measured, expected : Array
        Measurement and expectation, shape (ticks,).
    period : float
        Period of a tick, in s.
    mains : float
        Nominal mains frequency, in Hz.

    Returns
    -------
    EstimatedMotion
        Estimate in the unit of the measurement.
    """
    difference = remove_mains(measured - expected, period, mains)
    offset = float(np.mean(difference))
    padding = min(PADDING, len(difference) - 1)
    # Point reflection at both ends continues value and slope.
    start = 2 * difference[0] - difference[padding:0:-1]
    end = 2 * difference[-1] - difference[-2 : -2 - padding : -1]
    extended = np.concatenate([start, difference, end]) - offset
    frequencies, density = spectrum(difference - offset, period)
    # One-sided density of white noise: 2 σ² Δt.
    noise = 2 * white_noise(measured) ** 2 * period
    gain = wiener_gain(frequencies, density, noise)
    # A Wiener filter's error has the density noise·gain; (2πf)² differentiates it.
    error = math.sqrt(
        np.sum((2 * math.pi * frequencies) ** 2 * noise * gain) * float(frequencies[1])
    )
    grid = np.fft.rfftfreq(len(extended), period)
    filtered = np.fft.irfft(
        np.fft.rfft(extended) * np.interp(grid, frequencies, gain), len(extended)
    )
    correction = offset + filtered[padding : padding + len(difference)]
    return EstimatedMotion(expected + correction, correction, error)


class SmoothedMotion(NamedTuple):
    """Smoothed measurement of a motion.

    Attributes
    ----------
    motion : Array
        Motion, shape (ticks,).
    error : float
        Standard deviation of its error.
    rate_error : float
        Standard deviation of the error of its rate of change, in unit/s.
    resolution : float
        Time over which the filter spreads a sudden change, s: half a period of the highest
        frequency that it passes.
    """

    motion: Array
    error: float
    rate_error: float
    resolution: float


def smooth(signal: Array, period: float) -> SmoothedMotion:
    """Smooth a measured motion: parts that cannot be told from white noise are removed.

    Where the motion stays within the remaining error, it is taken as rest.

    Parameters
    ----------
    signal : Array
        Signal, shape (ticks,).
    period : float
        Period of a tick, in s.

    Returns
    -------
    SmoothedMotion
        Motion, and the standard deviations of its errors.
    """
    noise = white_noise(signal)
    count = len(signal)
    line = signal[0] + (signal[-1] - signal[0]) * np.arange(count) / max(count - 1, 1)
    swing = signal - line
    # Odd reflection about the line makes the signal periodic without a jump in value or slope.
    extended = np.concatenate([swing, -swing[-2:0:-1]])
    frequencies, density = spectrum(extended, period)
    gain = wiener_gain(frequencies, density, 2 * noise**2 * period)
    grid = np.fft.rfftfreq(len(extended), period)
    smoothed = (
        line
        + np.fft.irfft(np.fft.rfft(extended) * np.interp(grid, frequencies, gain), len(extended))[
            :count
        ]
    )
    error = noise * math.sqrt(float(np.mean(gain)))
    # What the filter passes of white noise has the one-sided density 2 σ² Δt · gain; (2πf)²
    # differentiates it.
    passed = (2 * math.pi * frequencies) ** 2 * gain
    rate_error = noise * math.sqrt(2 * period * float(np.sum(passed) * frequencies[1]))
    motion = _straighten_rests(smoothed, error, max(3, round(REST / period)))
    highest = frequencies[np.nonzero(gain)[0][-1]] if gain.any() else frequencies[1]
    return SmoothedMotion(motion, error, rate_error, 0.5 / max(float(highest), 1e-300))


def motion_band(signal: Array, period: float) -> float:
    """Return the frequency up to which a measured motion exceeds its noise.

    Parameters
    ----------
    signal : Array
        Signal, shape (ticks,).
    period : float
        Period of a tick, in s.

    Returns
    -------
    float
        Frequency in Hz at which `smooth` leaves half of the motion; infinite without noise.
    """
    noise = white_noise(signal)
    if noise == 0.0:
        return math.inf
    line = np.linspace(signal[0], signal[-1], len(signal))
    swing = signal - line
    frequencies, density = spectrum(np.concatenate([swing, -swing[-2:0:-1]]), period)
    gain = wiener_gain(frequencies, density, 2 * noise**2 * period)
    passed = np.nonzero(gain >= 0.5)[0]
    return float(frequencies[passed[-1]]) if len(passed) else math.inf


def _straighten_rests(motion: Array, error: float, window: int) -> Array:
    """Return a motion in which stretches within the error are replaced by straight lines."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    span = maximum_filter1d(motion, window) - minimum_filter1d(motion, window)
    still = np.diff(np.concatenate([[0], (span < STILL * error).astype(np.int8), [0]]))
    straight = motion.copy()
    for start, end in zip(np.nonzero(still == 1)[0], np.nonzero(still == -1)[0], strict=True):
        straight[start:end] = np.linspace(motion[start], motion[end - 1], end - start)
    return straight


def wiener_gain(frequencies: Array, density: Array, noise: float) -> Array:
    """Return the gain of a Wiener filter: 1 − noise/density up to a limit, and 0 above.

    The limit is the highest frequency at which the density, averaged over a fifth of an octave or
    nine lines, exceeds the noise's density.
    """
    smooth = np.empty_like(density)
    count = len(density)
    for first in range(0, count, 10):
        # Ten lines share one width; away from both ends they are averaged at once.
        half, end = max(4, first // 10), min(first + 10, count)
        low, high = max(first, half), min(end, count - half)
        if low < high:
            windows = sliding_window_view(density[low - half : high + half], 2 * half + 1)
            smooth[low:high] = np.mean(windows, axis=1)
        for line in (*range(first, min(low, end)), *range(max(low, high), end)):
            smooth[line] = np.mean(density[max(0, line - half) : line + half + 1])
    stands_out = (smooth > STANDS_OUT * noise) & (frequencies < HIGHEST_MOTION)
    if not stands_out.any():
        return np.zeros_like(density)
    highest = int(np.nonzero(stands_out)[0][-1])
    gain = np.clip(1.0 - noise / np.maximum(smooth, 1e-300), 0.0, 1.0)
    # Above the limit single lines stand out by chance; they are noise.
    gain[highest + 1 :] = 0.0
    return gain
