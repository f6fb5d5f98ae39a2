"""Initial position and velocity of a pushed joint, from one of its sensors."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigtwin.components.sensors import Sensor, remove_drift, slope_of, undo_static
from rigtwin.models.start import (
    LIKELY,
    Start,
    find_slopes,
    fit_start,
    read_start,
    start_error,
)
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.signals.noise import smallest_step, white_noise

SHOWS, FORGOTTEN = 10.0, 0.02
"""χ² above which the error of an initial state is visible. Share of its greatest effect below which
the effect counts as forgotten."""
STRETCHES = (1 / 16, 1 / 4, 1.0)
"""Growing shares of the recording to which the state is fitted where no sensor shows the
position."""
CLOSER = 0.1
"""Factor on the tolerance of the position from one of these fits to the next."""
AT_REST: Start = (0.0, 0.0)
Move = Callable[[Start, Array], Array]
"""Function of an initial state and a disturbance, N, shape (ticks,), that returns the motion. Its
first rows are position and velocity."""


def guess_place(velocity: Array, period: float) -> tuple[float, float]:
    """Guess the initial position of an oscillation about zero from its velocity.

    Parameters
    ----------
    velocity
        Measured velocity, m/s, shape (ticks,). The sensor may have an offset and a drift.
    period
        Time from tick to tick, s.

    Returns
    -------
    tuple
        Initial position and standard deviation of the position, m.
    """
    from scipy.signal import detrend  # Imported late: scipy is slow to load.

    # An offset would integrate to a ramp, so the velocity is detrended first.
    swing = np.cumsum(detrend(velocity)) * period
    return float(swing[0] - np.mean(swing)), float(np.std(swing))


class JointStart:
    """Initial state of a joint, read from a sensor and fitted where its error matters.

    A velocity sensor says nothing about the position. The joint is then assumed to oscillate about
    zero, and its initial position is fitted within that oscillation.

    Parameters
    ----------
    name
        Name of the sensor.
    kind
        Measured quantity: `position` or `velocity`.
    measured
        Measured signal, shape (ticks,).
    period
        Time from tick to tick, s.
    """

    def __init__(self, name: str, kind: str, measured: Array, period: float) -> None:
        self.name = name
        self._row = ("position", "velocity").index(kind)
        self._measured, self._period = measured, period
        self._remembered = len(measured)
        self._held, self._swings_freely = 0.0, False
        self._responses = np.zeros((2, 0, len(measured)))
        self._noise = max(white_noise(measured), smallest_step(measured) / np.sqrt(12.0))
        self._value, self._slope = read_start(measured, period)
        self._error = start_error(self._noise, period, len(measured))
        if kind == "velocity":
            self._place, swing = guess_place(measured, period)
            self._error = swing, self._error[0]

    @property
    def fitted(self) -> bool:
        """Whether the error of the state as read is visible in the predictions."""
        return self._held > 0.0

    @property
    def may_be_linear(self) -> bool:
        """Whether errors of the state as read are visible, and small enough to be linear.

        A velocity sensor shows no position, and a free oscillation is all of its start.
        """
        return self.fitted and self._row == 0 and not self._swings_freely

    def _read(self, sensor: Sensor) -> Start:
        quantity = undo_static(sensor, np.array([self._value]))
        if self._row == 1:
            return 0.0, float(quantity[0])
        slope = (self._slope - sensor.drift) / slope_of(sensor, quantity)
        return float(quantity[0]), float(slope[0])

    def judge(self, sensor: Sensor, move: Move, form: float, pushes: Array) -> None:
        """Decide whether the error of the state as read is visible, and for how long.

        Parameters
        ----------
        sensor
            Nominal sensor.
        move
            Motion from any initial state.
        form
            Declared model error, as a share of the sensor's signal.
        pushes
            Command of the actuator, shape (ticks,).
        """
        self._swings_freely = not float(np.ptp(pushes)) > 0.0
        held = max(form * float(np.std(self._measured)), self._noise)
        first, ticks = np.array(self._read(sensor)), self._remembered
        undisturbed = clip_diverged(_move_from(move, first, ticks))
        self._responses = np.stack(
            [
                clip_diverged(_move_from(move, first + step, ticks)) - undisturbed
                for step in np.diag(self._error)
            ]
        )
        change = self._responses[1 - self._row, self._row]
        size = np.abs(change)
        self._remembered = 1 + int(np.nonzero(size >= FORGOTTEN * size.max())[0][-1])
        self._held = held if float(change @ change) > SHOWS * held**2 else 0.0

    def correct(self, sensor: Sensor, moved: Array) -> Array:
        """Correct a motion from the state as read for errors of that state, to first order.

        They are linear nuisance parameters θ with a prior of `LIKELY` standard errors: with S the
        nominal responses and r the residual, θ = (Sᵀ S + I / LIKELY²)⁻¹ Sᵀ r. This takes one
        integration instead of several and is accurate enough for a search.

        Parameters
        ----------
        sensor
            Sensor with its parameters.
        moved
            Motion from the state as read, shape (rows, ticks).

        Returns
        -------
        array
            Corrected motion, shape (rows, ticks).
        """
        residual = self._measure(sensor) - moved[self._row, : self._remembered]
        # A wrong model must not be blamed on the initial state: its residual widens the tolerance.
        held = max(self._held, float(np.sqrt(np.mean(residual**2))))
        slopes = self._responses[:, self._row, : self._remembered] / held
        normal = slopes @ slopes.T + np.eye(len(slopes)) / LIKELY**2
        errors = np.linalg.solve(normal, slopes @ residual / held)
        return moved + np.tensordot(errors, self._responses[:, :, : moved.shape[1]], axes=1)

    def _measure(self, sensor: Sensor) -> Array:
        """Return the quantity behind the sensor while the joint remembers its start."""
        measured = remove_drift(sensor, self._measured[: self._remembered], self._period)
        return undo_static(sensor, measured)

    def find(self, sensor: Sensor, move: Move | None) -> Start:
        """Return the initial state.

        Parameters
        ----------
        sensor
            Sensor with its parameters.
        move
            Motion from any initial state; None to take the state as read.

        Returns
        -------
        tuple
            Position and velocity, m and m/s.
        """
        start = self._read(sensor)
        if move is None:
            return start
        measured = self._measure(sensor)
        first = np.array(start)
        error = np.array(self._error)
        if self._row == 0:
            return self._fit(measured, move, first, error)
        guessed = np.array([self._place / sensor.gain, start[1]])
        predict = self._predict_by(move, self._remembered)
        first = min(
            (first, guessed), key=lambda state: float(np.sum((predict(state) - measured) ** 2))
        )
        # A guessed position is too far off to fit the whole recording at once: the period of a
        # nonlinear oscillation depends on its amplitude, so the phase error grows with time.
        for share in STRETCHES:
            stretch = measured[: max(math.ceil(share * len(measured)), 2)]
            first = np.array(self._fit(stretch, move, first, error))
            error[0] *= CLOSER
        return float(first[0]), float(first[1])

    def _fit(self, measured: Array, move: Move, first: Array, error: Array) -> Start:
        predict = self._predict_by(move, len(measured))
        predicted = predict(first)
        slopes = find_slopes(predict, first, error, predicted)
        held = self._held
        if not self._swings_freely:
            # A wrong model must not be blamed on the initial state: its residual widens the
            # tolerance. Not so for a free oscillation, whose whole motion comes from its start.
            held = max(held, float(np.sqrt(np.mean((predicted - measured) ** 2))))
        state, _ = fit_start(predict, measured, first, error, held, slopes, predicted)
        return float(state[0]), float(state[1])

    def _predict_by(self, move: Move, ticks: int) -> Callable[[Array], Array]:
        """Return a function that predicts the sensor from an initial state, for some ticks."""

        def predict(start: Array) -> Array:
            return clip_diverged(_move_from(move, start, ticks)[self._row])

        return predict


def _move_from(move: Move, start: Array, ticks: int) -> Array:
    """Return the motion from an initial state, without a disturbance."""
    return move((float(start[0]), float(start[1])), np.zeros(ticks))
