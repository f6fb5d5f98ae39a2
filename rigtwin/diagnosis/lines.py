"""Weights of a recording's spectral lines: noise and declared model error of each signal.

The equation of `evidence` is used with its names: n_k for noise and m_k for the declared error.
Integration and rounding errors, d_k and b_k, are added there, as they need predictions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.fft import rfft, rfftfreq
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.spikes import JUMPS, SPIKE, despike
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import smallest_step, white_noise
from rigtwin.signals.runs import find_cut_off

HIGHEST_FREQUENCY = 150.0
"""Highest frequency that is compared, Hz. No component moves above it, so that further lines would
only add noise."""
MAINS_WIDTH = 0.8
"""Half width of the excluded band around the mains frequency, Hz."""
FULL_WEIGHT_TIME = 0.7
"""Time from which a test has full weight, s. By then the plates have forgotten their unknown
start."""
IGNORED_SHARE = 0.3
"""Share of `FULL_WEIGHT_TIME` that has no weight at all."""
LEAST_NOISE_SHARE = 1e-6
"""Lowest noise of a signal, as a share of its standard deviation."""
SMOOTHING_LINES = 8
"""Lines to either side over which a signal's power spectrum is averaged."""
NOISE_SMOOTHING_LINES = 32
"""Lines to either side over which the spectrum of a single draw of noise is averaged."""


@dataclass(frozen=True)
class Lines:
    """One recording in the frequency domain.

    Attributes
    ----------
    frequency
        Frequency of each line, Hz, shape (lines,).
    weight
        Factor applied to the transform of a residual, 1/sqrt(v) of the module's equation; 0 near
        the mains frequency; shape (rows, lines).
    spread
        Variance of the noise alone in each line, n of the module's equation, shape (rows, lines).
    fade
        Window applied to a residual in the time domain, 0 to 1, shape (rows, ticks).
    measured
        Measured signals, shape (rows, ticks).
    noise
        Noise rms of each signal, shape (rows,).
    bit
        Quantisation step of each signal, shape (rows,).
    length
        Length of the transform; at least the number of ticks.
    period
        Time from tick to tick, s.
    """

    frequency: Array
    weight: Array
    spread: Array
    fade: Array
    measured: Array
    noise: Array
    bit: Array
    length: int
    period: float

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Whether a tick of a signal has at least half the full weight, shape (rows, ticks)."""
        return self.fade > 0.5

    def mean(self, values: Array) -> Array:
        """Return the mean of each signal's values over the ticks that count, shape (rows,)."""
        return self.total(values) / np.maximum(self.counts.sum(axis=1), 1)

    def total(self, values: Array) -> Array:
        """Return the sum of each signal's values over the ticks that count, shape (rows,)."""
        return np.asarray(np.sum(values, axis=1, where=self.counts))


def weigh_lines(
    machine: Machine, recording: RecordedTest, model: Model[Any], plant: Plant, counted: Array
) -> Lines:
    """Transform a recording to the frequency domain and weigh each line of its signals.

    Parameters
    ----------
    machine
        Machine the recording belongs to.
    recording
        Recording that is transformed.
    model
        Model of the machine under the recording's inputs.
    plant
        Plant at which noise is propagated to the predictions.
    counted
        Weight of each tick, 0 to 1, shape (ticks,).

    Returns
    -------
    Lines
        The recording in the frequency domain.
    """
    whole = np.stack([recording.column(*row.channel) for row in machine.rows])
    # The band is limited before ticks are left out, or what lies above the new Nyquist frequency
    # would alias into it. The copy is needed, as the mains line is subtracted from it in place.
    measured = limit_band(whole, model.band, recording.period)[:, :: model.every].copy()
    period = model.every * recording.period
    limited = math.isfinite(model.band)
    length, frequency, off_mains = _choose_lines(
        measured.shape[1], period, model.band, plant.mains.frequency
    )
    floor, resolution = _noise_floors(whole)
    fade = _windows(recording, model, whole, counted)
    propagated = model.propagated_noise(plant)
    if propagated is not None:
        # A controller's command has no noise of its own; that of its sensors is propagated.
        floor[[row.kind == "command" for row in machine.rows]] = 0.0
    within = min(2.0 * model.band * recording.period, 1.0)
    noise = _residual_noise(floor, propagated, within)
    # Noise was filtered before ticks were left out, so none is folded into the band.
    folded = 1.0 / model.every if limited else 1.0
    spread = _noise_variance(
        machine, fade, floor, noise, propagated, folded, length, len(frequency)
    )
    error = _declared_error(machine, fade, measured, length, len(frequency))
    weight = off_mains / np.sqrt(spread + error + 1e-300)
    return Lines(
        frequency=frequency,
        weight=weight,
        spread=spread,
        fade=fade,
        measured=measured,
        noise=noise,
        # The band limit smooths the bits.
        bit=np.zeros_like(resolution) if limited else resolution,
        length=length,
        period=period,
    )


def _choose_lines(
    ticks: int, period: float, band: float, mains: float
) -> tuple[int, Array, NDArray[np.bool_]]:
    """Return the transform's length, the compared frequencies, and which are off the mains.

    The compared lines are the lowest ones, so they are the beginning of every spectrum.
    """
    # The FFT is fastest at lengths with small prime factors; zeros are appended.
    length = int(next_fast_len(ticks, real=True) or ticks)
    frequency = rfftfreq(length, period)
    # 0.5 / period is the Nyquist frequency. The lines just below it contain what sampling folds
    # back.
    frequency = frequency[frequency <= min(HIGHEST_FREQUENCY, 0.4 / period, band)]
    # A recording of duration T resolves frequencies to 1 / T, so in a short one the mains line is
    # as broad as that.
    width = max(MAINS_WIDTH, 2.0 / (ticks * period))
    return length, frequency, np.abs(frequency - mains) > width


def _declared_error(
    machine: Machine, fade: Array, measured: Array, length: int, count: int
) -> Array:
    """Return the variance of the declared model error of all signals, shape (rows, lines)."""
    errors = []
    for window, signal, row in zip(fade, measured, machine.rows, strict=True):
        # Without the mean: the window would spread its power over the lowest lines.
        swing = window * (signal - np.mean(signal))
        power = np.abs(rfft(swing, length)[:count]) ** 2
        errors.append(_model_error(power, machine.form_of(row), machine.prior.even))
    return np.stack(errors)


def _noise_floors(whole: Array) -> tuple[Array, Array]:
    """Return the noise rms and the quantisation step of each signal, shape (rows,) each.

    `whole` has the signals as recorded: the estimate of noise takes third differences, which a
    limited band would make too small.
    """
    noise = np.array([white_noise(row) for row in whole])
    resolution = np.array([smallest_step(row) for row in whole])
    # Rounding to a bit q is uniform noise of the rms q / sqrt(12).
    floor = np.maximum(noise, resolution / np.sqrt(12.0))
    # A signal without visible noise, such as a relay's, is still not known exactly.
    return np.maximum(floor, LEAST_NOISE_SHARE * np.std(whole, axis=1)), resolution


def _residual_noise(floor: Array, propagated: Array | None, within: float) -> Array:
    """Return the noise rms of each signal's residual, shape (rows,).

    `floor` is the noise of the signals, of which the band limit leaves the share `within` of the
    power. `propagated` is a draw of the noise of the predictions, shape (rows, ticks).
    """
    noise = floor * math.sqrt(within)
    if propagated is not None:
        noise = np.sqrt(noise**2 + np.var(propagated, axis=1))
    return np.maximum(noise, 1e-300)


def _windows(recording: RecordedTest, model: Model[Any], whole: Array, counted: Array) -> Array:
    """Return the window of each signal: 0 where a sensor is cut off or the model undetermined."""
    fade = np.stack(
        [
            (_fade(len(row), recording.period) * counted * ~find_cut_off(row))[:: model.every]
            for row in whole
        ]
    )
    if (undetermined := model.undetermined()) is not None:
        fade *= np.logical_not(undetermined)
    return fade


def _noise_variance(
    machine: Machine,
    fade: Array,
    floor: Array,
    noise: Array,
    propagated: Array | None,
    folded: float,
    length: int,
    count: int,
) -> Array:
    """Return the variance of noise in real and imaginary part of each line, n of the equation.

    `floor` is the noise of each signal and `noise` that of its residual. `propagated` is a draw of
    the noise that a measured motion adds to the prediction, shape (rows, ticks). `folded` is the
    share of white noise that leaving out ticks does not alias.
    """
    spread = np.empty((len(fade), count))
    for row in range(len(fade)):
        # A white sequence of the rms s under a window w has E|F_k|^2 = s^2 sum(w^2) in every line,
        # half of it in the real part.
        spread[row] = 0.5 * float(fade[row] @ fade[row]) * folded * floor[row] ** 2
        if propagated is not None:
            # Spikes are judged by the noise of the residual, from which they are removed as well.
            height = SPIKE * float(noise[row]) if machine.rows[row].kind in JUMPS else 0.0
            spread[row] += spectrum_of_noise(propagated[row], fade[row], length, height)[:count]
    return spread


def _model_error(power: Array, form: float, even: float) -> Array:
    """Return the variance of the declared model error in each line, m of the equation.

    The error follows the signal's spectrum where the model is known. It is spread evenly where the
    frequency content of the unmodelled part is unknown.
    """
    error = 0.5 * form**2 * (even * float(np.mean(power)) + (1.0 - even) * smooth(power))
    # The error is declared for a signal's swing and does not apply to its mean.
    error[0] *= even
    return error


def spectrum_of_noise(noise: Array, fade: Array, length: int, height: float) -> Array:
    """Return half the power of a draw of noise in each line, averaged over neighbouring lines.

    Spikes higher than `height` are removed first, as they are from the residual; 0 keeps them.
    """
    if height > 0.0:
        noise = noise.copy()
        despike(noise, height)
    # One draw has exponentially distributed powers; averaging over 65 lines leaves 12 % of scatter.
    return 0.5 * smooth(np.abs(rfft(fade * noise, length)) ** 2, NOISE_SMOOTHING_LINES)


def smooth(power: Array, lines: int = SMOOTHING_LINES) -> Array:
    """Average a power spectrum over neighbouring lines to either side.

    A spectrum too short for that is averaged over fewer lines.
    """
    # A kernel longer than the spectrum would make `same` return the kernel's length. `same` pads
    # with zeros, which lowers the average at both ends by half at most.
    lines = min(lines, (len(power) - 1) // 2)
    return np.convolve(power, np.ones(2 * lines + 1) / (2 * lines + 1), mode="same")


def _fade(ticks: int, period: float) -> Array:
    """Return a window that is 0 while the rig's state is unknown and then rises to 1.

    The rise is half a period of a cosine, so that the window adds no high frequencies.
    """
    # A fixed fade would cost a short recording most of its data, so it takes at most 15 % of the
    # duration.
    time, end = np.arange(ticks) * period, min(FULL_WEIGHT_TIME, 0.15 * ticks * period)
    rise = (time / end - IGNORED_SHARE) / (1.0 - IGNORED_SHARE)
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(rise, 0.0, 1.0))
