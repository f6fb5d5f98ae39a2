"""What recordings say of a plant: the difference between predicted and measured sensors, whitened,
frequency by frequency.

Commands are known exactly, so whatever a plant's prediction leaves is noise or a gap. Each line of
the difference's spectrum is weighed by what may be there without meaning: the sensor's white noise,
estimated from the data, and a small share of the signal, since no model is exact. The mains line
says nothing of the plant and is left out.
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

HIGHEST = 150.0
"""Hz; above it no component moves and lines would only add noise."""
MAINS_WIDTH = 0.8
"""Hz to either side of the mains line that is left out."""
STARTED = 0.7
"""s, from which a test counts in full: by then the plates have left whatever they started from."""
UNSEEN = 0.3
"""Share of that which does not count at all."""
COARSER = 4.0
"""How much more variance than rounding the prediction shows is put down to a coarse sensor's
bits."""
NOISELESS = 1e-6
"""Share of a signal's standard deviation that its noise has at least."""
COARSE_BIT = 2.0
"""Bits of this many times the noise, which they themselves then are, are seen in the signal."""
JUMPS = ("force", "command")
"""What jumps where dry friction does; motions do not."""
SPIKE = 4.0
"""Times its noise by which a sample stands out of those about it to be a spike."""
COARSE = 4.0
"""How much more variance than a halved step shows is put down to the integration."""
SEARCHED = 2.5e-3
"""s, between ticks in a search."""
FINEST = 0.8e-3
"""s, of an integration step that is short enough for every machine."""
FEWEST_STEPS = 2
"""Of integration a tick, of a rough model: half of them for a search."""
STEPPED = 0.05
"""Share of what a rough model is held to that twice the integration steps may change."""
SMOOTHED = 8
"""Lines to either side over which a signal's spectrum is averaged."""
UNKNOWN = 10
"""Ticks at either end at which a measured motion's acceleration is not known."""
WIDELY = 32
"""The same for noise, of which one draw is taken."""


@dataclass(frozen=True)
class Lines:
    """One recording in the frequency domain. frequency: Hz, shape (lines,); weight: what a
    difference's transform is multiplied by, shape (rows, lines); spread: variance of noise alone in
    each line, shape (rows, lines); fade: what a difference is multiplied by before, shape (rows,
    ticks); measured: shape (rows, ticks); noise: rms of each signal's, shape (rows,); bit: size of
    one of each signal, shape (rows,); period: s, from tick to tick."""

    frequency: Array
    weight: Array
    spread: Array
    fade: Array
    measured: Array
    noise: Array
    bit: Array
    length: int
    period: float


def lines(
    machine: Machine, recording: Recording, model: Model[Any], plant: Plant, counted: Array
) -> Lines:
    """The lines of a recording's signals, and their weights about a plant.

    Parameters
    ----------
    machine
        That it is of.
    recording
        The data.
    model
        Of the machine under the recording's inputs.
    plant
        That the weights are taken about.
    counted
        How much each tick counts, 0 to 1, shape (ticks,).

    Returns
    -------
    Lines
        The recording in the frequency domain.
    """
    whole = np.stack([recording.column(*row.channel) for row in machine.rows])
    measured = limit_band(whole, model.band, recording.period)[:, :: model.every].copy()
    rows, ticks = measured.shape
    period = model.every * recording.period
    limited = math.isfinite(model.band)
    length = int(next_fast_len(ticks, real=True) or ticks)
    frequency = rfftfreq(length, period)
    kept = frequency <= min(HIGHEST, 0.4 / period, model.band)
    width = max(MAINS_WIDTH, 2.0 / (ticks * period))
    off_mains = np.abs(frequency[kept] - plant.mains.frequency) > width
    noise = np.array([white_noise(row) for row in whole])
    resolution = np.array([smallest_step(row) for row in whole])
    floor = np.maximum(noise, resolution / np.sqrt(12.0))
    # A signal without visible noise, such as a relay's, is still not known exactly.
    floor = np.maximum(floor, NOISELESS * np.std(whole, axis=1))
    fade = np.stack(
        [
            (_fade(len(row), recording.period) * counted * ~find_cut_off(row))[:: model.every]
            for row in whole
        ]
    )
    if (undetermined := model.undetermined()) is not None:
        fade *= np.logical_not(undetermined)
    if (carried := model.propagated_noise(plant)) is not None:
        # A controller's command has no noise but its sensors'.
        floor[[row.kind == "command" for row in machine.rows]] = 0.0
    weight, spread = np.empty((rows, int(kept.sum()))), np.empty((rows, int(kept.sum())))
    for row in range(rows):
        form = machine.form_of(machine.rows[row])
        swing = fade[row] * (measured[row] - np.mean(measured[row]))
        power = np.abs(rfft(swing, length)[kept]) ** 2
        # Noise was filtered before ticks were left out, so none is folded into the band.
        folded = 1.0 / model.every if limited else 1.0
        spread[row] = 0.5 * float(fade[row] @ fade[row]) * folded * floor[row] ** 2
        if carried is not None:
            height = SPIKE * float(floor[row]) if machine.rows[row].kind in JUMPS else 0.0
            spread[row] += _spectrum_of_noise(carried[row], fade[row], length, height)[
                : int(kept.sum())
            ]
        # The declared model error follows the signal's spectrum where the model is known, and is
        # spread evenly where nobody can say how what the model lacks is distributed.
        even = machine.prior.even
        error = 0.5 * form**2 * (even * float(np.mean(power)) + (1.0 - even) * _smooth(power))
        # The error of a signal's swing says nothing of its mean.
        error[0] *= even
        variance = spread[row] + error + 1e-300
        weight[row] = off_mains / np.sqrt(variance)
    if limited:
        # Of white noise only what lies in the band is left, and no bits.
        floor = floor * math.sqrt(min(2.0 * model.band * recording.period, 1.0))
        resolution = np.zeros_like(resolution)
    if carried is not None:
        floor = np.sqrt(floor**2 + np.var(carried, axis=1))
    floor = np.maximum(floor, 1e-300)
    return Lines(
        frequency=frequency[kept],
        weight=weight,
        spread=spread,
        fade=fade,
        measured=measured,
        noise=floor,
        bit=resolution,
        length=length,
        period=period,
    )


def _model_with_enough_steps(
    machine: Machine, recording: Recording, configuration: Configuration, most: int
) -> Model[Any]:
    """The model with so few integration steps that twice as many change little of what it is held
    to."""
    steps = FEWEST_STEPS
    model = machine.physics.model(machine, recording.inputs, configuration, steps)
    held = [
        max(
            white_noise(recording.column(*row.channel)),
            machine.form_of(row) * float(np.std(recording.column(*row.channel))),
        )
        for row in machine.rows
    ]
    predicted = model.predict(configuration.plant)
    while steps < most:
        finer = model.double_steps()
        following = finer.predict(configuration.plant)
        change = np.sqrt(np.mean((following - predicted) ** 2, axis=1))
        if bool(np.all(change <= STEPPED * np.array(held))):
            break
        model, predicted, steps = finer, following, 2 * steps
    return model


def _spectrum_of_noise(noise: Array, fade: Array, length: int, height: float) -> Array:
    """Half the power of a draw of noise in each line, averaged widely, as it is one draw.

    height: above which spikes are taken out, as they are of the residual; 0 for none.
    """
    if height > 0.0:
        noise = noise.copy()
        despike(noise, height)
    return 0.5 * _smooth(np.abs(rfft(fade * noise, length)) ** 2, WIDELY)


def _smooth(power: Array, lines: int = SMOOTHED) -> Array:
    """Averaged over neighbouring lines to either side, fewer of a spectrum that has no more."""
    lines = min(lines, (len(power) - 1) // 2)
    return np.convolve(power, np.ones(2 * lines + 1) / (2 * lines + 1), mode="same")


def _fade(ticks: int, period: float) -> Array:
    """Nothing of the start, where the rig's state is not known, then a rise to 1."""
    time, end = np.arange(ticks) * period, min(STARTED, 0.15 * ticks * period)
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((time / end - UNSEEN) / (1.0 - UNSEEN), 0.0, 1.0))


@kernel
def despike(signal: Array, height: float) -> None:
    """Replaces what stands out of the median of seven neighbours by more than `height`, in
    place."""
    ticks = len(signal)
    if ticks < 7:
        return
    original = signal.copy()
    # Whatever is that close to three of its neighbours does not stand out: no median is needed.
    close = np.zeros(ticks, np.int8)
    for away in (-3, -2, -1, 1, 2, 3):
        for tick in range(3, ticks - 3):
            close[tick] += np.int8(abs(original[tick + away] - original[tick]) <= height)
    window = np.empty(7)
    for tick in range(3, ticks - 3):
        if close[tick] >= 3:
            continue
        window[:] = original[tick - 3 : tick + 4]
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
    """Recordings of one rig, and how far a plant's predictions are from them.

    Residuals are whitened: of unit variance at most if the plant is right. expected: their χ² if
    nothing but white noise is left. Several recordings stand one after another. models: under each
    one's inputs.
    """

    def __init__(
        self,
        machine: Machine,
        recordings: Sequence[Recording],
        configurations: Sequence[Configuration],
        counted: Sequence[Array] | None = None,
        steps: int = 4,
    ) -> None:
        """configurations: of the twin, one for each recording, alike in their plant; counted: how
        much each tick counts, 0 to 1; steps: of integration a tick."""
        self._counted = counted or [np.ones(recording.ticks) for recording in recordings]
        self.machine, self.recordings, self.configurations = (
            machine,
            tuple(recordings),
            tuple(configurations),
        )
        self.names = [row.name for row in machine.rows]
        self.plant: Plant = self.configurations[0].plant
        self.models = [
            _model_with_enough_steps(machine, r, c, max(steps, round(r.period / FINEST)))
            for r, c in zip(recordings, configurations, strict=True)
        ]
        self._transform()

    def _transform(self) -> None:
        """Takes the recordings to the frequency domain, as the models predict them."""
        machine = self.machine
        self.lines = [
            lines(machine, recording, model, c.plant, part)
            for recording, model, c, part in zip(
                self.recordings, self.models, self.configurations, self._counted, strict=True
            )
        ]
        # The line's foot reaches beyond the lines left out, so it is taken out of the signals too.
        for each, predicted in zip(self.lines, self.predict(self.plant), strict=True):
            for row, expected in zip(each.measured, predicted, strict=True):
                row -= (row - expected) - remove_mains(
                    row - expected, each.period, self.plant.mains.frequency
                )
        self._loosen()
        self._round()
        # Noise and the declared model error together are no gap.
        self.expected = sum(float(2 * np.count_nonzero(each.weight)) for each in self.lines)

    def excess_noise(self, plant: Plant) -> list[Array | None]:
        """Noise that the motions which drive a model carry at a plant beyond that at the nominal.

        Dry friction reverses where a noisy motion does, so that a plant with friction has more.

        Parameters
        ----------
        plant
            Plant whose predictions are meant.

        Returns
        -------
        list
            Variance in units of what the weights assume, shape (rows, lines) for each recording;
            None where nothing noisy drives the model.
        """
        found: list[Array | None] = []
        for model, each in zip(self.models, self.lines, strict=True):
            carried = model.propagated_noise(plant)
            if carried is None:
                found.append(None)
                continue
            count = len(each.frequency)
            heights = [
                SPIKE * float(noise) if row.kind in JUMPS else 0.0
                for noise, row in zip(each.noise, self.machine.rows, strict=True)
            ]
            spread = np.stack(
                [
                    _spectrum_of_noise(row, fade, each.length, height)[:count]
                    for row, fade, height in zip(carried, each.fade, heights, strict=True)
                ]
            )
            found.append(np.maximum(spread - each.spread, 0.0) * each.weight**2)
        return found

    def halve_steps(self) -> Evidence:
        """The same with half as many integration steps: for a search, not for its result."""
        like = copy(self)
        like.models = [model.halve_steps() for model in self.models]
        return like

    def thin(self) -> Evidence:
        """The same with ticks left out, as far as the models can do without: for a search."""
        like = copy(self)
        like.models = [model.thin(SEARCHED) for model in self.models]
        if all(model is own for model, own in zip(like.models, self.models, strict=True)):
            return self
        like._transform()
        return like

    def _loosen(self) -> None:
        """Adds to what no line is held to what half the integration step would change."""
        for each, model in zip(self.lines, self.models, strict=True):
            change = each.fade * (
                model.predict(self.plant) - model.double_steps().predict(self.plant)
            )
            power = np.abs(rfft(change, each.length, axis=1)[:, : len(each.frequency)]) ** 2
            for row in range(len(self.names)):
                variance = COARSE * 0.5 * _smooth(power[row])
                each.weight[row] /= np.sqrt(1.0 + variance * each.weight[row] ** 2)

    def _round(self) -> None:
        """Adds what the bits of a coarse sensor leave, which is no white noise but follows the
        signal."""
        for each, predicted in zip(self.lines, self.predict(self.plant), strict=True):
            for row in range(len(self.names)):
                bit = float(each.bit[row])
                if bit > COARSE_BIT * each.noise[row]:
                    rounded = each.fade[row] * (
                        np.round(predicted[row] / bit) * bit - predicted[row]
                    )
                    power = np.abs(rfft(rounded, each.length))[: len(each.frequency)] ** 2
                    variance = 0.5 * COARSER * _smooth(power)
                    each.weight[row] /= np.sqrt(1.0 + variance * each.weight[row] ** 2)

    def predict(self, plant: Plant) -> list[Array]:
        """The sensors of every recording as a plant would have them.

        Parameters
        ----------
        plant
            Whose predictions are meant.

        Returns
        -------
        list of arrays
            One a recording, shape (rows, ticks) each.
        """
        return [model.predict(plant) for model in self.models]

    def differences(self, plant: Plant) -> list[Array]:
        """Measured less predicted, spikes apart.

        What a friction that changes sign a tick early or late leaves says nothing of its size, and
        jumps when anything changes.

        Parameters
        ----------
        plant
            Whose predictions are meant.

        Returns
        -------
        list of arrays
            One a recording, shape (rows, ticks) each.
        """
        return self._subtract(self.predict(plant))

    def _subtract(self, predictions: Sequence[Array]) -> list[Array]:
        found = []
        for each, predicted in zip(self.lines, predictions, strict=True):
            difference = each.measured - predicted
            for row, meaning in enumerate(self.machine.rows):
                if meaning.kind in JUMPS:
                    despike(difference[row], SPIKE * float(each.noise[row]))
            found.append(difference)
        return found

    def whiten(self, differences: Sequence[Array]) -> Array:
        """Differences as one whitened vector.

        Parameters
        ----------
        differences
            In the time domain, one a recording, shape (rows, ticks) each.

        Returns
        -------
        array
            Real and imaginary parts of all lines, one after another.
        """
        return np.concatenate(
            [
                part.ravel()
                for each in self.transforms(differences)
                for part in (each.real, each.imag)
            ]
        )

    def transforms(self, differences: Sequence[Array]) -> Iterator[NDArray[np.complex128]]:
        """The same before it becomes a vector, shape (rows, lines) for each recording."""
        for each, difference in zip(self.lines, differences, strict=True):
            yield (
                rfft(each.fade * difference, each.length, axis=1)[:, : len(each.frequency)]
                * each.weight
            )

    def missing_force(self, plant: Plant) -> Array | None:
        """What would have to act besides for what goes by itself to go as measured, N, all
        recordings one after another; None where nothing goes by itself. The ends are left out,
        where accelerations are not known."""
        parts = [model.missing_force(plant) for model in self.models]
        known = [part[UNKNOWN:-UNKNOWN] for part in parts if part is not None]
        return np.concatenate(known) if len(known) == len(parts) else None

    def residual(self, plant: Plant) -> Array:
        """Measured less predicted."""
        return self.whiten(self.differences(plant))

    def residual_of(self, predictions: Sequence[Array]) -> Array:
        """The residual of predictions, shape (rows, ticks) each, however they were made."""
        return self.whiten(self._subtract(predictions))

    def width(self, tolerance: Tolerance) -> float:
        """A tolerance's half width here, in its parameter's unit."""
        return tolerance.width(self.plant, self.recordings[0].period)

    def shift(self, plant: Plant, widths: Sequence[float]) -> Plant:
        """A plant that uses its tolerances.

        Parameters
        ----------
        plant
            Whose predictions are meant.
        widths
            By how many half widths, one a tolerance.

        Returns
        -------
        Plant
            With the parameters moved.
        """
        for tolerance, share in zip(self.machine.tolerances, widths, strict=True):
            if share:
                plant = tolerance.shift(plant, share * self.width(tolerance))
        return plant

    def tolerance_responses(self, plant: Plant) -> Array:
        """What each tolerance's half width does to the prediction at a plant.

        Parameters
        ----------
        plant
            Whose predictions are meant.

        Returns
        -------
        array
            Whitened, shape (size, tolerances).
        """
        before = self.predict(plant)
        columns = []
        for tolerance in self.machine.tolerances:
            width = self.width(tolerance)
            after, scale = self.predict(tolerance.shift(plant, width)), 1.0
            start = before
            if tolerance.mechanical and width > 0.0:
                # Friction answers a change unevenly: from both sides, half of it is gone.
                start, scale = self.predict(tolerance.shift(plant, -width)), 0.5
            columns.append(
                self.whiten([scale * (b - a) for a, b in zip(start, after, strict=True)])
            )
        if not columns:
            return np.zeros((sum(2 * each.weight.size for each in self.lines), 0))
        return np.stack(columns, axis=1)


def relative_errors(evidence: Evidence, plant: Plant) -> Array:
    """What a plant leaves of each recording.

    Parameters
    ----------
    evidence
        The recordings.
    plant
        Whose predictions are meant.

    Returns
    -------
    array
        rms of what is left, in units of the signals' own standard deviation, or of their noise
        where that is larger; shape (recordings,).
    """
    found = []
    for each, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        counts = each.fade.max(axis=0) > 0.5
        own = np.maximum(np.std(each.measured, axis=1), each.noise)
        left = (each.measured - predicted)[:, counts] / own[:, None]
        found.append(float(np.sqrt(np.mean(left**2))))
    return np.array(found)
