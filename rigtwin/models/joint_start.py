"""Where a pushed joint is and how fast it goes when a recording starts, by a sensor of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigtwin.components.sensors import Sensor, remove_drift
from rigtwin.models.start import Start, find_slopes, fit_start, read_start, start_error
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.signals.noise import smallest_step, white_noise

SHOWS, FORGOTTEN = 10.0, 0.02
"""χ² from which the error of a start shows, and share of its greatest effect below which it does no
more."""
STRETCHES = (1 / 16, 1 / 4, 1.0)
"""Shares of a record to which one start after another is fitted where no sensor sees the place,"""
CLOSER = 0.1
"""and how much less far off than the one before it each may be."""
AT_REST: Start = (0.0, 0.0)
Move = Callable[[Start, Array], Array]
"""Motion, its first rows position and velocity, from a start and under another force of shape
(ticks,)."""


def guess_place(velocity: Array, period: float) -> tuple[float, float]:
    """Where what swings about 0 is at its start.

    Parameters
    ----------
    velocity
        As measured, of a sensor of any zero that may drift, shape (ticks,).
    period
        s, of a tick.

    Returns
    -------
    tuple
        The place, and the swing's standard deviation.
    """
    from scipy.signal import detrend  # Late: it takes a second.

    swing = np.cumsum(detrend(velocity)) * period
    return float(swing[0] - np.mean(swing)), float(np.std(swing))


class JointStart:
    """Read from a sensor of position or velocity; fitted where an error of it shows.

    A sensor of velocity says nothing of where the joint is. What swings about a place is taken to
    do so about 0, within the swing.
    """

    def __init__(self, name: str, kind: str, measured: Array, period: float) -> None:
        """name: of the sensor; kind: position or velocity; measured: shape (ticks,); period: s."""
        self.name = name
        self._row = ("position", "velocity").index(kind)
        self._measured, self._period = measured, period
        self._remembered = len(measured)
        self._held, self._swings_freely = 0.0, False
        self._noise = max(white_noise(measured), smallest_step(measured) / np.sqrt(12.0))
        self._value, self._slope = read_start(measured, period)
        self._error = start_error(self._noise, period, len(measured))
        if kind == "velocity":
            self._place, swing = guess_place(measured, period)
            self._error = swing, self._error[0]

    @property
    def fitted(self) -> bool:
        """Whether the error of a start shows."""
        return self._held > 0.0

    def _read(self, sensor: Sensor) -> Start:
        value = (self._value - sensor.offset) / sensor.gain
        if self._row == 1:
            return 0.0, value
        return value, (self._slope - sensor.drift) / sensor.gain

    def judge(self, sensor: Sensor, move: Move, form: float, pushes: Array) -> None:
        """Find whether the error of a start as it is read shows, and for how long. form: the error
        of the machine's form, as a share of what the sensor reads; pushes: what is commanded."""
        self._swings_freely = not float(np.ptp(pushes)) > 0.0
        held = max(form * float(np.std(self._measured)), self._noise)
        predict, first = self._predict_by(move, self._remembered), np.array(self._read(sensor))
        other = first.copy()
        other[1 - self._row] += self._error[1 - self._row]
        change = predict(other) - predict(first)
        size = np.abs(change)
        self._remembered = 1 + int(np.nonzero(size >= FORGOTTEN * size.max())[0][-1])
        self._held = held if float(change @ change) > SHOWS * held**2 else 0.0

    def find(self, sensor: Sensor, move: Move | None) -> Start:
        """The start as the sensor has it.

        Parameters
        ----------
        sensor
            Its values.
        move
            The machine from any start; None where nothing is to be fitted.

        Returns
        -------
        tuple
            Position and velocity.
        """
        start = self._read(sensor)
        if move is None:
            return start
        measured = remove_drift(sensor, self._measured[: self._remembered], self._period)
        measured = (measured - sensor.offset) / sensor.gain
        first = np.array(start)
        error = np.array(self._error)
        if self._row == 0:
            return self._fit(measured, move, first, error)
        there = np.array([self._place / sensor.gain, start[1]])
        predict = self._predict_by(move, self._remembered)
        first = min((first, there), key=lambda each: float(np.sum((predict(each) - measured) ** 2)))
        # A place that is guessed is too far off for the whole at once: a swing's pace depends on
        # how wide it is.
        for share in STRETCHES:
            stretch = measured[: max(math.ceil(share * len(measured)), 2)]
            first = np.array(self._fit(stretch, move, first, error))
            error[0] *= CLOSER
        return float(first[0]), float(first[1])

    def _fit(self, measured: Array, move: Move, first: Array, error: Array) -> Start:
        predict = self._predict_by(move, len(measured))
        here = predict(first)
        slopes = find_slopes(predict, first, error, here)
        held = self._held
        if not self._swings_freely:
            # A model that is far off elsewhere too is no reason to start otherwise. What nothing
            # else moves has all its motion from its start, and from how it was let go.
            held = max(held, float(np.sqrt(np.mean((here - measured) ** 2))))
        found = fit_start(predict, measured, first, error, held, slopes, here)
        return float(found[0]), float(found[1])

    def _predict_by(self, move: Move, ticks: int) -> Callable[[Array], Array]:
        """What the sensor sees from any start, for so many ticks."""

        def predict(start: Array) -> Array:
            moved = move((float(start[0]), float(start[1])), np.zeros(ticks))
            return clip_diverged(moved[self._row])

        return predict
