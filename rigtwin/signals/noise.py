"""Noise estimated from data: the white part of a signal, the mains line, and the motion beneath."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rigtwin.numerics.arrays import Array

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the magnitude of a standard normal variable."""
MAINS_SEARCH = 0.5
"""Distance from the nominal mains frequency within which the line is searched, in Hz."""
STANDS_OUT = 1.5
"""Ratio of a spectrum to the noise's from which it counts as motion."""
PADDING = 1000
"""Number of samples by which a signal is extended at both ends before filtering."""
REST, STILL = 0.1, 6.0
"""Duration of a rest, in s, and the range of a motion, in its errors, that counts as rest."""
HIGHEST_MOTION = 200.0
"""Highest frequency of measurable motion, in Hz, of plates and carriages of such a rig."""


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


def smooth(signal: Array, period: float) -> tuple[Array, float]:
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
    tuple of Array and float
        Motion, shape (ticks,), and the standard deviation of its error.
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
    return _straighten_rests(smoothed, error, max(3, round(REST / period))), error


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
