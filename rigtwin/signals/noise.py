"""Noise estimated from the data.

The white part of a signal, the mains line, and the motion beneath a noisy sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigtwin.numerics.arrays import Array

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""
MAINS_SEARCH = 0.5
"""Hz either side of the nominal mains frequency within which the line is looked for."""
STANDS_OUT = 1.5
"""A residual's spectrum this many times the noise's is motion, not noise."""
PADDING = 1000
"""Samples by which a signal is continued at both ends before it is filtered."""
REST, STILL = 0.1, 6.0
"""s without motion, and the errors of a motion within which it is none."""
HIGHEST_MOTION = 200.0
"""Hz; no plate or carriage of such a rig moves measurably above."""


SWITCHED = 4
"""Values in all up to which a signal is switched, and its steps are no bits."""


def white_noise(signal: Array) -> float:
    """Standard deviation of a signal's white noise.

    From third differences, which leave nothing of smooth motion and 3 % of a 50 Hz line at 1 kHz,
    and their median, which ignores the jumps of dry friction. Var(Δ³ noise) = 20 σ². Where coarse
    bits make most of them zero, their rms is taken. A signal that is switched between few values
    shows no noise at all.
    """
    third = np.diff(signal, 3)
    if _is_switched(signal):
        return 0.0
    typical = float(np.median(np.abs(third))) / NORMAL_MEDIAN
    return (typical or rms(third)) / math.sqrt(20.0)


def _is_switched(signal: Array) -> bool:
    """Whether a signal has few values in all, as that of a relay; a constant one is none."""
    # The first samples of most signals show at once that they have more.
    start = signal[: 64 * SWITCHED]
    return len(np.unique(start)) <= SWITCHED and 1 < len(np.unique(signal)) <= SWITCHED


def smallest_step(signal: Array) -> float:
    """The signal's bit.

    The smallest difference of two of its values, rounding apart; 0 if it shows none.
    """
    values = np.unique(signal)
    if len(values) <= SWITCHED:
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * max(float(np.ptp(signal)), 1e-300)]
    if not len(steps):
        return 0.0
    bit = float(np.min(steps))
    # On a lattice every step is a whole number of bits.
    share = np.abs(steps / bit - np.round(steps / bit))
    return bit if float(np.mean(share < 0.02)) > 0.9 else 0.0


def rms(signal: Array) -> float:
    """Root mean square, mean included."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(signal**2)))


def remove_mains(signal: Array, period: float, frequency: float) -> Array:
    """Removes the mains line from a signal; its mean stays.

    Parameters
    ----------
    signal : Array
        Shape (ticks,).
    period : float
        s.
    frequency : float
        Hz, nominal; the line is looked for within ±0.5 Hz of it.

    Returns
    -------
    Array
        Shape (ticks,). The signal as it is where it was sampled too slowly to show the line: of 50
        samples a second the line would be a constant.
    """
    if frequency + MAINS_SEARCH >= 0.5 / period:
        return signal.copy()
    count = len(signal)
    time = np.arange(count) * period
    centred = signal - np.mean(signal)
    window = np.hanning(count)
    grid = np.fft.rfftfreq(count, period)
    near = np.abs(grid - frequency) <= MAINS_SEARCH
    if near.sum() < 3:
        return _remove_line(signal, centred, window, time, frequency)
    peak = grid[near][np.argmax(np.abs(np.fft.rfft(window * centred))[near])]
    width = grid[1]

    def power(candidate: float) -> float:
        return -abs(np.sum(window * centred * np.exp(-2j * math.pi * candidate * time)))

    from scipy.optimize import minimize_scalar  # Late: so are scipy.signal and scipy.ndimage below.

    found = minimize_scalar(
        power,
        bounds=(peak - width, peak + width),
        method="bounded",
        options={"xatol": width * 1e-3},
    )
    return _remove_line(signal, centred, window, time, float(found.x))


def _remove_line(
    signal: Array, centred: Array, window: Array, time: Array, frequency: float
) -> Array:
    basis = np.column_stack(
        [np.cos(2 * math.pi * frequency * time), np.sin(2 * math.pi * frequency * time)]
    )
    weights, *_ = np.linalg.lstsq(window[:, None] * basis, window * centred, rcond=None)
    return signal - basis @ weights


def spectrum(signal: Array, period: float) -> tuple[Array, Array]:
    """One-sided power spectral density, mean included: frequencies in Hz, density in unit²/Hz."""
    # Loading it takes half a second, which most commands need not wait for.
    from scipy.signal import welch

    return welch(signal, 1.0 / period, nperseg=min(4096, len(signal)), detrend=False)  # type: ignore[arg-type]


def band(signal: Array, period: float) -> tuple[float, float]:
    """The band in Hz that holds the middle 80 % of the signal's power, mean included.

    (0, 0) for no signal.
    """
    frequencies, density = spectrum(signal, period)
    if not density.any():
        return 0.0, 0.0
    share = np.cumsum(density) / np.sum(density)
    low, high = np.searchsorted(share, [0.1, 0.9])
    return float(frequencies[low]), float(frequencies[high])


@dataclass(frozen=True)
class EstimatedMotion:
    """A motion estimated beneath a noisy measurement.

    Parameters
    ----------
    position : Array
        Shape (ticks,).
    correction : Array
        What of it is not as expected, shape (ticks,).
    velocity_error : float
        Standard deviation of its rate of change, unit/s.
    """

    position: Array
    correction: Array
    velocity_error: float


def estimate_motion(
    measured: Array, expected: Array, period: float, mains: float
) -> EstimatedMotion:
    """Estimates the motion beneath a noisy measurement, given what a model expects of it.

    Where measured − expected is noise, the expectation is the better estimate of the motion, plus
    a constant offset. What stands out of the noise is kept by a Wiener filter, 1 − noise/spectrum
    at every frequency: of all linear estimates the one with the least error, in position and in
    velocity.

    Parameters
    ----------
    measured, expected : Array
        Shape (ticks,).
    period : float
        s.
    mains : float
        Nominal mains frequency, Hz.

    Returns
    -------
    EstimatedMotion
        In the unit of the measurement.
    """
    difference = remove_mains(measured - expected, period, mains)
    offset = float(np.mean(difference))
    padding = min(PADDING, len(difference) - 1)
    start, end = (
        2 * difference[0] - difference[padding:0:-1],
        2 * difference[-1] - difference[-2 : -2 - padding : -1],
    )
    extended = np.concatenate([start, difference, end]) - offset
    frequencies, density = spectrum(difference - offset, period)
    noise = 2 * white_noise(measured) ** 2 * period
    gain = wiener_gain(frequencies, density, noise)
    # The error of a Wiener filter has the density noise·gain; it is differentiated here.
    error = math.sqrt(
        np.sum((2 * math.pi * frequencies) ** 2 * noise * gain) * float(frequencies[1])
    )
    grid = np.fft.rfftfreq(len(extended), period)
    kept = np.fft.irfft(np.fft.rfft(extended) * np.interp(grid, frequencies, gain), len(extended))
    correction = offset + kept[padding : padding + len(difference)]
    return EstimatedMotion(expected + correction, correction, error)


def smooth(signal: Array, period: float) -> tuple[Array, float]:
    """Smooths a measured motion: what is not to be told from its white noise is left out.

    Where it stays within the error that is left it is taken to rest.

    Parameters
    ----------
    signal : Array
        Shape (ticks,).
    period : float
        s.

    Returns
    -------
    tuple of Array and float
        The motion, shape (ticks,), and the standard deviation of its error.
    """
    noise = white_noise(signal)
    count = len(signal)
    line = signal[0] + (signal[-1] - signal[0]) * np.arange(count) / max(count - 1, 1)
    swing = signal - line
    # Mirrored, so that it goes on as smoothly as it can at both ends.
    extended = np.concatenate([swing, -swing[-2:0:-1]])
    frequencies, density = spectrum(extended, period)
    gain = wiener_gain(frequencies, density, 2 * noise**2 * period)
    grid = np.fft.rfftfreq(len(extended), period)
    kept = (
        line
        + np.fft.irfft(np.fft.rfft(extended) * np.interp(grid, frequencies, gain), len(extended))[
            :count
        ]
    )
    error = noise * math.sqrt(float(np.mean(gain)))
    return _straighten_rests(kept, error, max(3, round(REST / period))), error


def motion_band(signal: Array, period: float) -> float:
    """Find up to which frequency a measured motion stands out of its noise.

    Parameters
    ----------
    signal : Array
        Shape (ticks,).
    period : float
        s.

    Returns
    -------
    float
        Hz, where `smooth` leaves half of the motion; infinite without noise.
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
    """The motion with stretches in which it stays within its error straightened."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    span = maximum_filter1d(motion, window) - minimum_filter1d(motion, window)
    still = np.diff(np.concatenate([[0], (span < STILL * error).astype(np.int8), [0]]))
    found = motion.copy()
    for start, end in zip(np.nonzero(still == 1)[0], np.nonzero(still == -1)[0], strict=True):
        found[start:end] = np.linspace(motion[start], motion[end - 1], end - start)
    return found


def wiener_gain(frequencies: Array, density: Array, noise: float) -> Array:
    """Gives the gain of a Wiener filter: 1 − noise/density where there is motion, 0 above.

    Motion goes up to the highest frequency at which the density, averaged over a fifth of an octave
    or nine lines, stands out of the noise's density.
    """
    smooth = np.empty_like(density)
    for line in range(len(density)):
        half = max(4, line // 10)
        smooth[line] = np.mean(density[max(0, line - half) : line + half + 1])
    stands_out = (smooth > STANDS_OUT * noise) & (frequencies < HIGHEST_MOTION)
    if not stands_out.any():
        return np.zeros_like(density)
    highest = int(np.nonzero(stands_out)[0][-1])
    gain = np.clip(1.0 - noise / np.maximum(smooth, 1e-300), 0.0, 1.0)
    gain[highest + 1 :] = 0.0
    return gain
