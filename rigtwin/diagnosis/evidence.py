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

from collections.abc import Iterator, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.fft import rfft
from numpy.typing import NDArray

from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.tolerance import Tolerance
from rigtwin.diagnosis.effort import Effort
from rigtwin.diagnosis.lines import smooth, spectrum_of_noise, weigh_lines
from rigtwin.diagnosis.spikes import JUMPS, SPIKE, despike
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import remove_mains, white_noise

ROUNDING_FACTOR = 4.0
"""Factor applied to the variance of the rounded prediction, since the true rounding errors differ
from the predicted ones."""
COARSE_BIT_RATIO = 2.0
"""Ratio of bit to noise above which the rounding error follows the signal and is not white."""
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
UNKNOWN_ENDS = 10
"""Ticks at either end of a recording at which the measured acceleration is unknown."""


def _model_with_enough_steps(
    machine: Machine, recording: RecordedTest, configuration: Configuration, most: int
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
    effort
        Account of what predictions cost; None where nobody counts.
    """

    def __init__(
        self,
        machine: Machine,
        recordings: Sequence[RecordedTest],
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
        self.effort: Effort | None = None
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
        """Return the propagated noise at a plant less that at the nominal plant.

        Dry friction reverses where a noisy measured motion does, so that a plant with friction
        propagates more noise. A lag smooths the prediction and propagates less.

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
                    spectrum_of_noise(row, fade, lines.length, height)[:count]
                    for row, fade, height in zip(propagated, lines.fade, heights, strict=True)
                ]
            )
            # weight² is 1 / v, so the excess becomes relative to the variance of the line.
            excesses.append((spread - lines.spread) * lines.weight**2)
        return excesses

    def halve_steps(self) -> Evidence:
        """Return the same evidence with half the integration steps, for use in a search only."""
        # The shallow copy shares lines and weights, so that misfits of both have the same meaning.
        coarse = copy(self)
        coarse.models = [model.halve_steps() for model in self.models]
        return coarse

    def near(self, plant: Plant) -> Evidence:
        """Return the same evidence for plants that resemble one, which are predicted faster."""
        similar = copy(self)
        similar.models = [model.near(plant) for model in self.models]
        return similar

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
                variance = STEP_ERROR_FACTOR * 0.5 * smooth(power[row])
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
                    variance = 0.5 * ROUNDING_FACTOR * smooth(power)
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
        if self.effort is not None:
            self.effort.add(sum(model.effort for model in self.models))
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
            if tolerance.is_idle(plant):
                columns.append(np.zeros(sum(2 * lines.weight.size for lines in self.lines)))
                continue
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
        scale = np.maximum(np.std(lines.measured, axis=1), lines.noise)
        relative = (lines.measured - predicted) / scale[:, None]
        errors.append(float(np.sqrt(np.mean(lines.mean(relative**2)))))
    return np.array(errors)
