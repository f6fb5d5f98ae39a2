"""Whitened residual of recordings: measured less predicted signals, weighted line by line of their
spectrum.

The commands of a recording are known exactly, so a prediction misses the measured signals only by
noise or by a gap between twin and machine. Let y be a measured signal, p its prediction at a plant,
and w a window that excludes the unknown start. The whitened residual in line k of the spectrum is

    r_k = F[w (y - p)]_k / sqrt(v_k),        v_k = n_k + m_k + d_k + b_k,

where F is the discrete Fourier transform and v_k the variance that real and imaginary part may each
have without any meaning [Whittle, Ark. Mat. 2 (1953) 423]:

    n_k    noise: s^2 sum(w^2) / 2 of white noise with the rms s, and the noise of a measured motion
           that the model propagates to the prediction;
    m_k    declared model error: f^2 (e mean(P) + (1 - e) P_k) / 2, where f is the declared share of
           the signal, P its power spectrum, and e the share of the error that is spread evenly;
    d_k    integration error: from the change when the integration step is halved;
    b_k    rounding error of a coarse sensor: from the rounded prediction.

If the plant is right, real and imaginary parts of r have at most unit variance, and the sum of
their squares is a chi-square. Lines near the mains frequency carry no information about the plant
and have weight 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.fft import rfft, rfftfreq
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.tolerance import Tolerance
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import remove_mains, smallest_step, white_noise
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
ROUNDING_FACTOR = 4.0
"""Factor applied to the variance of the rounded prediction, since the true rounding errors differ
from the predicted ones."""
LEAST_NOISE_SHARE = 1e-6
"""Lowest noise of a signal, as a share of its standard deviation."""
COARSE_BIT_RATIO = 2.0
"""Ratio of bit to noise above which the rounding error follows the signal and is not white."""
JUMPS = ("force", "command")
"""Kinds of signal that jump where dry friction reverses. Positions and velocities do not."""
SPIKE = 4.0
"""Height above its neighbours from which a sample is a spike, in units of the signal's noise."""
STEP_ERROR_FACTOR = 4.0
"""Factor applied to the variance of the change when the integration step is halved."""
SEARCH_PERIOD = 2.5e-3
"""Longest period of the predicted ticks in a search, s."""
FINEST_STEP = 0.8e-3
"""Integration step that is short enough for every machine, s."""
FEWEST_STEPS = 2
"""Minimum number of integration steps per tick. A search uses half."""
STEP_TOLERANCE = 0.05
"""Largest change when the integration step is halved, as a share of noise or declared error."""
SMOOTHING_LINES = 8
"""Lines to either side over which a signal's power spectrum is averaged."""
UNKNOWN_ENDS = 10
"""Ticks at either end of a recording at which the measured acceleration is unknown."""
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


def weigh_lines(
    machine: Machine, recording: Recording, model: Model[Any], plant: Plant, counted: Array
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
    ticks = measured.shape[1]
    period = model.every * recording.period
    limited = math.isfinite(model.band)
    # The FFT is fastest at lengths with small prime factors; zeros are appended.
    length = int(next_fast_len(ticks, real=True) or ticks)
    frequency = rfftfreq(length, period)
    # 0.5 / period is the Nyquist frequency. The lines just below it contain what sampling folds
    # back.
    used = frequency <= min(HIGHEST_FREQUENCY, 0.4 / period, model.band)
    # A recording of duration T resolves frequencies to 1 / T, so in a short one the mains line is
    # as broad as that.
    width = max(MAINS_WIDTH, 2.0 / (ticks * period))
    off_mains = np.abs(frequency[used] - plant.mains.frequency) > width
    # The estimate takes third differences, which a limited band would make too small: hence
    # `whole`.
    noise = np.array([white_noise(row) for row in whole])
    resolution = np.array([smallest_step(row) for row in whole])
    # Rounding to a bit q is uniform noise of the rms q / sqrt(12).
    floor = np.maximum(noise, resolution / np.sqrt(12.0))
    # A signal without visible noise, such as a relay's, is still not known exactly.
    floor = np.maximum(floor, LEAST_NOISE_SHARE * np.std(whole, axis=1))
    fade = _windows(recording, model, whole, counted)
    propagated = model.propagated_noise(plant)
    if propagated is not None:
        # A controller's command has no noise of its own; that of its sensors is propagated.
        floor[[row.kind == "command" for row in machine.rows]] = 0.0
    # Noise was filtered before ticks were left out, so none is folded into the band.
    folded = 1.0 / model.every if limited else 1.0
    spread = _noise_variance(machine, fade, floor, propagated, folded, length, int(used.sum()))
    weight = np.empty_like(spread)
    for row in range(len(measured)):
        swing = fade[row] * (measured[row] - np.mean(measured[row]))
        power = np.abs(rfft(swing, length)[used]) ** 2
        error = _model_error(power, machine.form_of(machine.rows[row]), machine.prior.even)
        variance = spread[row] + error + 1e-300
        weight[row] = off_mains / np.sqrt(variance)
    if limited:
        # The band limit leaves only the share of white noise within it, and smooths the bits.
        floor = floor * math.sqrt(min(2.0 * model.band * recording.period, 1.0))
        resolution = np.zeros_like(resolution)
    if propagated is not None:
        floor = np.sqrt(floor**2 + np.var(propagated, axis=1))
    floor = np.maximum(floor, 1e-300)
    return Lines(
        frequency=frequency[used],
        weight=weight,
        spread=spread,
        fade=fade,
        measured=measured,
        noise=floor,
        bit=resolution,
        length=length,
        period=period,
    )


def _windows(recording: Recording, model: Model[Any], whole: Array, counted: Array) -> Array:
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
    propagated: Array | None,
    folded: float,
    length: int,
    count: int,
) -> Array:
    """Return the variance of noise in real and imaginary part of each line, n of the equation.

    `propagated` is a draw of the noise that a measured motion adds to the prediction, shape (rows,
    ticks). `folded` is the share of white noise that leaving out ticks does not alias.
    """
    spread = np.empty((len(fade), count))
    for row in range(len(fade)):
        # A white sequence of the rms s under a window w has E|F_k|^2 = s^2 sum(w^2) in every line,
        # half of it in the real part.
        spread[row] = 0.5 * float(fade[row] @ fade[row]) * folded * floor[row] ** 2
        if propagated is not None:
            height = SPIKE * float(floor[row]) if machine.rows[row].kind in JUMPS else 0.0
            spread[row] += _spectrum_of_noise(propagated[row], fade[row], length, height)[:count]
    return spread


def _model_error(power: Array, form: float, even: float) -> Array:
    """Return the variance of the declared model error in each line, m of the equation.

    The error follows the signal's spectrum where the model is known. It is spread evenly where the
    frequency content of the unmodelled part is unknown.
    """
    error = 0.5 * form**2 * (even * float(np.mean(power)) + (1.0 - even) * _smooth(power))
    # The error is declared for a signal's swing and does not apply to its mean.
    error[0] *= even
    return error


def _model_with_enough_steps(
    machine: Machine, recording: Recording, configuration: Configuration, most: int
) -> Model[Any]:
    """Return the model with the fewest integration steps per tick that predict precisely enough.

    The steps suffice once doubling them changes every signal by less than a small share of its
    noise or declared error. `most` is an upper bound.
    """
    steps = FEWEST_STEPS
    model = machine.physics.model(machine, recording.inputs, configuration, steps)
    allowed = [
        max(
            white_noise(recording.column(*row.channel)),
            machine.form_of(row) * float(np.std(recording.column(*row.channel))),
        )
        for row in machine.rows
    ]
    predicted = model.predict(configuration.plant)
    # For an integrator of order p the change is (1 - 2^-p) of the coarser model's error, so at
    # least half of it (Richardson).
    while steps < most:
        finer = model.double_steps()
        refined = finer.predict(configuration.plant)
        change = np.sqrt(np.mean((refined - predicted) ** 2, axis=1))
        if bool(np.all(change <= STEP_TOLERANCE * np.array(allowed))):
            break
        model, predicted, steps = finer, refined, 2 * steps
    return model


def _spectrum_of_noise(noise: Array, fade: Array, length: int, height: float) -> Array:
    """Return half the power of a draw of noise in each line, averaged over neighbouring lines.

    Spikes higher than `height` are removed first, as they are from the residual; 0 keeps them.
    """
    if height > 0.0:
        noise = noise.copy()
        despike(noise, height)
    # One draw has exponentially distributed powers; averaging over 65 lines leaves 12 % of scatter.
    return 0.5 * _smooth(np.abs(rfft(fade * noise, length)) ** 2, NOISE_SMOOTHING_LINES)


def _smooth(power: Array, lines: int = SMOOTHING_LINES) -> Array:
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


class Evidence:
    """Recordings of one machine, and their whitened residuals at any plant.

    A whitened vector holds all recordings one after another, and of each recording the real and
    then the imaginary parts of all lines of all signals.

    Attributes
    ----------
    machine
        Machine the recordings belong to.
    recordings, configurations
        Recordings fitted jointly, and the twin's configuration of each.
    names
        Names of the signals, in the order of their rows.
    plant
        Nominal plant.
    models
        Model of the machine under the inputs of each recording.
    lines
        Each recording in the frequency domain.
    expected
        Chi-square of the residual if only noise and declared model error remain.
    """

    def __init__(
        self,
        machine: Machine,
        recordings: Sequence[Recording],
        configurations: Sequence[Configuration],
        counted: Sequence[Array] | None = None,
        steps: int = 4,
    ) -> None:
        """Choose the integration steps of each model, and weigh the recordings' spectra.

        Parameters
        ----------
        machine
            Machine the recordings belong to.
        recordings
            Recordings fitted jointly.
        configurations
            Configuration of the twin for each recording. All have the same plant.
        counted
            Weight of each tick, 0 to 1, shape (ticks,) for each recording. Defaults to 1.
        steps
            Upper bound on the integration steps per tick, where a tick is short.
        """
        self._counted = counted or [np.ones(recording.ticks) for recording in recordings]
        self.machine, self.recordings, self.configurations = (
            machine,
            tuple(recordings),
            tuple(configurations),
        )
        self.names = [row.name for row in machine.rows]
        self.plant: Plant = self.configurations[0].plant
        self.models = [
            _model_with_enough_steps(machine, r, c, max(steps, round(r.period / FINEST_STEP)))
            for r, c in zip(recordings, configurations, strict=True)
        ]
        self._transform()

    def _transform(self) -> None:
        """Transform the recordings to the frequency domain, at the ticks that the models predict.

        The order matters: weights start from noise and declared error, and the integration and
        rounding errors are then added to their variance.
        """
        machine = self.machine
        self.lines = [
            weigh_lines(machine, recording, model, c.plant, part)
            for recording, model, c, part in zip(
                self.recordings, self.models, self.configurations, self._counted, strict=True
            )
        ]
        # Spectral leakage of the mains line reaches beyond the excluded lines, so the line is
        # subtracted in the time domain as well. It is estimated from the residual, as the signal
        # itself may have power at that frequency.
        for lines, predictions in zip(self.lines, self.predict(self.plant), strict=True):
            for row, expected in zip(lines.measured, predictions, strict=True):
                row -= (row - expected) - remove_mains(
                    row - expected, lines.period, self.plant.mains.frequency
                )
        self._add_integration_error()
        self._add_rounding_error()
        # Noise and the declared model error together are no gap.
        self.expected = sum(float(2 * np.count_nonzero(lines.weight)) for lines in self.lines)

    def excess_noise(self, plant: Plant) -> list[Array | None]:
        """Return the propagated noise at a plant beyond that at the nominal plant.

        Dry friction reverses where a noisy measured motion does, so that a plant with friction
        propagates more noise.

        Parameters
        ----------
        plant
            Plant whose predictions are compared.

        Returns
        -------
        list
            Variance in units of the variance that the weights assume, shape (rows, lines) for each
            recording. None where the model has no noisy input.
        """
        excesses: list[Array | None] = []
        for model, lines in zip(self.models, self.lines, strict=True):
            propagated = model.propagated_noise(plant)
            if propagated is None:
                excesses.append(None)
                continue
            count = len(lines.frequency)
            heights = [
                SPIKE * float(noise) if row.kind in JUMPS else 0.0
                for noise, row in zip(lines.noise, self.machine.rows, strict=True)
            ]
            spread = np.stack(
                [
                    _spectrum_of_noise(row, fade, lines.length, height)[:count]
                    for row, fade, height in zip(propagated, lines.fade, heights, strict=True)
                ]
            )
            # weight² is 1 / v, so the excess becomes relative to the variance of the line.
            excesses.append(np.maximum(spread - lines.spread, 0.0) * lines.weight**2)
        return excesses

    def halve_steps(self) -> Evidence:
        """Return the same evidence with half the integration steps, for use in a search only."""
        # The shallow copy shares lines and weights, so that misfits of both have the same meaning.
        coarse = copy(self)
        coarse.models = [model.halve_steps() for model in self.models]
        return coarse

    def thin(self) -> Evidence:
        """Return the same evidence with fewer ticks where the models allow it, for a search."""
        # Other ticks have other spectra, so unlike in `halve_steps` the lines are computed anew.
        thinned = copy(self)
        thinned.models = [model.thin(SEARCH_PERIOD) for model in self.models]
        if all(model is whole for model, whole in zip(thinned.models, self.models, strict=True)):
            return self
        thinned._transform()
        return thinned

    def _add_integration_error(self) -> None:
        """Add the integration error to the variance of each line, d of the module's equation."""
        for lines, model in zip(self.lines, self.models, strict=True):
            change = lines.fade * (
                model.predict(self.plant) - model.double_steps().predict(self.plant)
            )
            power = np.abs(rfft(change, lines.length, axis=1)[:, : len(lines.frequency)]) ** 2
            for row in range(len(self.names)):
                variance = STEP_ERROR_FACTOR * 0.5 * _smooth(power[row])
                # 1/sqrt(v + d) = (1/sqrt(v)) / sqrt(1 + d / v); a weight of 0 stays 0.
                lines.weight[row] /= np.sqrt(1.0 + variance * lines.weight[row] ** 2)

    def _add_rounding_error(self) -> None:
        """Add the rounding error of coarse sensors to each line, b of the module's equation.

        A bit larger than the noise leaves an error that follows the signal and is not white.
        """
        for lines, predictions in zip(self.lines, self.predict(self.plant), strict=True):
            for row in range(len(self.names)):
                bit = float(lines.bit[row])
                if bit > COARSE_BIT_RATIO * lines.noise[row]:
                    rounded = lines.fade[row] * (
                        np.round(predictions[row] / bit) * bit - predictions[row]
                    )
                    power = np.abs(rfft(rounded, lines.length))[: len(lines.frequency)] ** 2
                    variance = 0.5 * ROUNDING_FACTOR * _smooth(power)
                    lines.weight[row] /= np.sqrt(1.0 + variance * lines.weight[row] ** 2)

    def predict(self, plant: Plant) -> list[Array]:
        """Predict the sensors of every recording.

        Parameters
        ----------
        plant
            Plant that is simulated.

        Returns
        -------
        list of arrays
            Predicted signals of each recording, shape (rows, ticks).
        """
        return [model.predict(plant) for model in self.models]

    def differences(self, plant: Plant) -> list[Array]:
        """Return measured less predicted signals without spikes.

        Where friction changes sign a tick early or late, the residual has a spike. Its height is
        independent of the friction's error and jumps with any change of a parameter.

        Parameters
        ----------
        plant
            Plant whose predictions are compared.

        Returns
        -------
        list of arrays
            Residual of each recording, shape (rows, ticks).
        """
        return self._subtract(self.predict(plant))

    def _subtract(self, predictions: Sequence[Array]) -> list[Array]:
        """Subtract predictions from the measured signals, and remove spikes of those that jump."""
        differences = []
        for lines, predicted in zip(self.lines, predictions, strict=True):
            difference = lines.measured - predicted
            for number, row in enumerate(self.machine.rows):
                if row.kind in JUMPS:
                    despike(difference[number], SPIKE * float(lines.noise[number]))
            differences.append(difference)
        return differences

    def whiten(self, differences: Sequence[Array]) -> Array:
        """Return differences as one whitened vector.

        Parameters
        ----------
        differences
            Differences in the time domain, shape (rows, ticks) for each recording.

        Returns
        -------
        array
            Real and imaginary parts of all lines, shape (size,).
        """
        return np.concatenate(
            [
                part.ravel()
                for spectrum in self.transforms(differences)
                for part in (spectrum.real, spectrum.imag)
            ]
        )

    def transforms(self, differences: Sequence[Array]) -> Iterator[NDArray[np.complex128]]:
        """Yield the weighted spectra of differences, shape (rows, lines) for each recording."""
        for lines, difference in zip(self.lines, differences, strict=True):
            # The compared lines are the lowest ones, so they are the beginning of the spectrum.
            yield (
                rfft(lines.fade * difference, lines.length, axis=1)[:, : len(lines.frequency)]
                * lines.weight
            )

    def missing_force(self, plant: Plant) -> Array | None:
        """Return the residual force required to reproduce the measured motion.

        Parameters
        ----------
        plant
            Plant whose equation of motion is evaluated along the measured motion.

        Returns
        -------
        array or None
            Force of all recordings one after another, N, shape (size,), without the ends at which
            the acceleration is unknown. None where no measured joint moves freely.
        """
        parts = [model.missing_force(plant) for model in self.models]
        known = [part[UNKNOWN_ENDS:-UNKNOWN_ENDS] for part in parts if part is not None]
        # All recordings or none, so that the vectors of all plants have one length.
        return np.concatenate(known) if len(known) == len(parts) else None

    def residual(self, plant: Plant) -> Array:
        """Return the whitened residual at a plant, shape (size,)."""
        return self.whiten(self.differences(plant))

    def residual_of(self, predictions: Sequence[Array]) -> Array:
        """Return the whitened residual of given predictions, shape (rows, ticks) per recording."""
        return self.whiten(self._subtract(predictions))

    def width(self, tolerance: Tolerance) -> float:
        """Return the half width of a tolerance at the nominal plant, in its parameter's unit."""
        return tolerance.width(self.plant, self.recordings[0].period)

    def shift(self, plant: Plant, widths: Sequence[float]) -> Plant:
        """Move the toleranced parameters of a plant.

        Parameters
        ----------
        plant
            Plant that is changed.
        widths
            Displacement of each tolerance, in half widths.

        Returns
        -------
        Plant
            The plant with the parameters moved.
        """
        for tolerance, share in zip(self.machine.tolerances, widths, strict=True):
            if share:
                plant = tolerance.shift(plant, share * self.width(tolerance))
        return plant

    def tolerance_responses(self, plant: Plant) -> Array:
        """Return the response of the prediction to the half width of each tolerance.

        Parameters
        ----------
        plant
            Plant at which the tolerances are shifted.

        Returns
        -------
        array
            Whitened responses, shape (size, tolerances).
        """
        before = self.predict(plant)
        columns = []
        for tolerance in self.machine.tolerances:
            # A sensor's tolerance acts linearly, for which one side suffices.
            width = self.width(tolerance)
            after, scale = self.predict(tolerance.shift(plant, width)), 1.0
            start = before
            if tolerance.mechanical and width > 0.0:
                # Stick and slip respond differently to a rise and a fall of a parameter. A central
                # difference cancels half of that asymmetry.
                start, scale = self.predict(tolerance.shift(plant, -width)), 0.5
            columns.append(
                self.whiten([scale * (b - a) for a, b in zip(start, after, strict=True)])
            )
        if not columns:
            return np.zeros((sum(2 * lines.weight.size for lines in self.lines), 0))
        return np.stack(columns, axis=1)


def relative_errors(evidence: Evidence, plant: Plant) -> Array:
    """Return the relative prediction error of each recording at a plant.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    array
        rms of measured less predicted signals, in units of each signal's standard deviation, or of
        its noise where that is larger; shape (recordings,).
    """
    errors = []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        # The state of the twin is unknown at the start of a recording, where no signal has weight
        # yet.
        counts = lines.fade.max(axis=0) > 0.5
        scale = np.maximum(np.std(lines.measured, axis=1), lines.noise)
        relative = (lines.measured - predicted)[:, counts] / scale[:, None]
        errors.append(float(np.sqrt(np.mean(relative**2))))
    return np.array(errors)
