"""Initial positions and velocities of coupled joints, from the sensors that see them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of, slope_of, undo_static
from rigtwin.models.joint_start import FORGOTTEN, SHOWS, guess_place
from rigtwin.models.seen import Judged, Neighbour, Seen
from rigtwin.models.start import (
    CLOSE,
    ERRORS,
    LIKELY,
    find_slopes,
    fit_start,
    read_start,
    start_error,
)
from rigtwin.numerics.arrays import Array

FIRMNESS, CLOSELY = 1e-3, 10.0
"""Least-squares weights of a joint's position in the MJCF and of a measured velocity. A measured
position and its slope have weight 1."""
PASSES = 3
"""Largest number of times that the derivatives are taken at a new state."""
FALLS = 0.6
"""Share to which a pass must lower the residual for another one to follow."""
NEAR = 0.3
"""Steps of the derivatives about a fitted state, in standard errors of the state as read: a fitted
state is more certain, but dry friction has kinks."""
Sense = Callable[[Array, int], Array]
"""Function of an initial state, shape (2, coordinates), and a number of ticks that returns the
predicted rows, shape (rows, ticks)."""


class InitialState:
    """Initial state, read from sensors and fitted where its error matters.

    Parameters
    ----------
    seen
        Sensors that see coordinates, by name.
    place
        Positions of the coordinates in the MJCF, m, shape (coordinates,).
    loose
        Number of free coordinates; they come first.
    period
        Time from tick to tick, s.

    Attributes
    ----------
    loose : int
        Number of free coordinates.
    growth : float
        Largest factor by which an error of a position grows until the last tick, by `judge`.
    """

    def __init__(self, seen: Mapping[str, Seen], place: Array, loose: int, period: float) -> None:
        self._seen, self._place, self._period = dict(seen), place, period
        self.loose = loose
        self._judged: Judged | None = None
        self.growth = 1.0
        self._inverses: dict[bool, tuple[Array, ...]] = {}
        # What the samples say does not depend on the plant.
        self._begun = {
            name: read_start(seen.measured, period, seen.noise, seen.earlier)
            for name, seen in self._seen.items()
        }
        placed = [each.along for each in self._seen.values() if each.kind == "position"]
        self._unplaced = ~np.any(np.array(placed).reshape(-1, len(place)) != 0.0, axis=0)

    @property
    def fitted(self) -> bool:
        """Whether the error of the state as read is visible in the predictions."""
        return self._judged is not None

    def read(self, plant: Plant, swinging: bool = False) -> Array:
        """Return positions and velocities by the first samples, shape (2, coordinates).

        A joint without a sensor stands where the MJCF has it, at rest. A joint whose velocity alone
        is measured stands there too; with `swinging`, its position is that of an oscillation about
        zero.
        """
        # Weighted least squares, with the MJCF's position as a weak prior that makes it solvable.
        firm = FIRMNESS * np.eye(len(self._place))
        places: list[Array] = [firm]
        rates: list[Array] = [firm]
        positions: list[Array] = [FIRMNESS * self._place]
        speeds: list[Array] = [np.zeros(len(self._place))]
        for name, seen in self._seen.items():
            sensor = sensor_of(plant, name)
            value, slope = self._begun[name]
            # A late sensor shows where the joint was.
            value += slope * (sensor.delay + sensor.lag)
            quantity = undo_static(sensor, np.array([value]))
            if seen.kind == "position":
                places.append(seen.along[None])
                positions.append(quantity - seen.zero)
                rates.append(seen.along[None])
                speeds.append((slope - sensor.drift) / slope_of(sensor, quantity))
                continue
            rates.append(CLOSELY * seen.along[None])
            speeds.append(CLOSELY * quantity)
            if swinging and np.all(self._unplaced[seen.along != 0.0]):
                place, _ = guess_place(seen.measured, self._period)
                places.append(seen.along[None])
                positions.append(np.array([place / sensor.gain]))
        if swinging not in self._inverses:
            # The directions of the sensors do not depend on the plant, and a prediction of many
            # windows reads as many states.
            inverse = tuple(np.linalg.pinv(np.concatenate(rows)) for rows in (places, rates))
            self._inverses = {**self._inverses, swinging: inverse}
        start = [
            inverse @ np.concatenate(values)
            for inverse, values in zip(self._inverses[swinging], (positions, speeds), strict=True)
        ]
        return np.array(start, np.float64, order="C")

    def judge(self, plant: Plant, rows: Mapping[int, tuple[Seen, float]], sense: Sense) -> None:
        """Decide whether the error of the state as read is visible, and for how long.

        Parameters
        ----------
        plant
            Nominal components.
        rows
            Index of each position or velocity row → its sensor, and the declared model error as a
            share of the signal.
        sense
            Prediction from any initial state.
        """
        if not rows:
            return
        noises = [each.noise for each, _ in rows.values()]
        held = np.array(
            [
                max(form * float(np.std(each.measured)), noise, 1e-100)
                for (each, form), noise in zip(rows.values(), noises, strict=True)
            ]
        )
        ticks = len(next(iter(rows.values()))[0].measured)
        errors = self._find_errors([each for each, _ in rows.values()], noises, ticks)
        start, numbers = self.read(plant), list(rows)
        whole = sense(start, ticks)
        responses = self._respond(start, sense, errors, whole)
        self.growth = self._find_growth(rows, responses, errors)
        by_row = responses[numbers]
        # Largest effect of any error at each tick, in standard deviations: its square sum is the χ²
        # that a wrong initial state costs.
        size = np.max(np.abs(by_row) / held[:, None, None], axis=(0, 2))
        if float(np.sum(size**2)) <= SHOWS:
            return
        remembered = 1 + int(np.nonzero(size >= FORGOTTEN * size.max())[0][-1])
        self._judged = Judged(
            rows=tuple(numbers),
            measured=np.stack([each.measured[:remembered] for each, _ in rows.values()]),
            held=held,
            errors=errors,
            slopes=by_row[:, :remembered].reshape(-1, len(errors)),
            ticks=remembered,
            responses=responses,
        )

    def _find_growth(
        self, rows: Mapping[int, tuple[Seen, float]], responses: Array, errors: Array
    ) -> float:
        """Return the largest factor by which an error of a joint's position grows in a sensor."""
        growth = 1.0
        for row, (seen, _) in rows.items():
            for joint in np.nonzero(seen.along[: self.loose])[0]:
                if seen.kind == "position":
                    begun = abs(seen.along[joint] * errors[joint])
                    largest = float(np.max(np.abs(responses[row, :, joint])))
                    growth = max(growth, largest / max(begun, 1e-300))
        return growth

    @property
    def linear(self) -> bool:
        """Whether the linear `correct` may replace `find`.

        It may not where no sensor shows a free joint's position: its error is too large for that.
        """
        return not self._unplaced[: self.loose].any()

    def correct(self, predicted: Array, moved: Array) -> Array:
        """Correct a prediction for errors of the initial state, to first order.

        This takes one integration instead of several and is accurate enough for a search.

        Parameters
        ----------
        predicted
            Prediction of all rows, shape (rows, ticks).
        moved
            Standard errors by which the prediction's initial state differs from the state as read,
            shape (unknowns,).

        Returns
        -------
        array
            Corrected prediction, shape (rows, ticks).
        """
        if self._judged is None:
            return predicted
        return predicted + self._judged.responses @ self._solve(predicted, moved)

    def move(self, plant: Plant, predicted: Array) -> tuple[Array, Array]:
        """Move the state as read by its errors, to first order.

        Parameters
        ----------
        plant
            Components of the machine.
        predicted
            Prediction of all rows from the state as read, shape (rows, ticks).

        Returns
        -------
        tuple of arrays
            The moved state, shape (2, coordinates), and by how many standard errors, shape
            (unknowns,).
        """
        state = self.read(plant)
        if self._judged is None:
            return state, np.zeros(2 * self.loose)
        errors = self._solve(predicted, np.zeros(2 * self.loose))
        moved = self._free(state) + errors * self._judged.errors
        state[:, : self.loose] = moved.reshape(2, -1)
        return state, errors

    def _solve(self, predicted: Array, moved: Array) -> Array:
        """Return the errors of the initial state, in standard errors, shape (unknowns,).

        They are linear nuisance parameters θ with a prior of LIKELY standard errors about the state
        as read, from which the prediction is off by θ₀ already: with S the responses and r the
        residual, θ = (Sᵀ S + I / LIKELY²)⁻¹ (Sᵀ r − θ₀ / LIKELY²).
        """
        judged = self._judged
        assert judged is not None
        residual = judged.measured - predicted[list(judged.rows), : judged.ticks]
        # A wrong model must not be blamed on the initial state: its residual widens the tolerance.
        power = np.einsum("rt,rt->r", residual, residual) / judged.ticks
        weights = 1.0 / np.maximum(judged.held**2, power)
        count = len(moved)
        normal = (weights @ judged.squares.reshape(len(weights), -1)).reshape(count, count)
        normal.ravel()[:: count + 1] += 1.0 / LIKELY**2
        pull = (weights[:, None] * residual).ravel() @ judged.slopes - moved / LIKELY**2
        return np.linalg.solve(normal, pull)

    def find(self, plant: Plant, sense: Sense) -> Array:
        """Return the initial state, fitted if necessary, shape (2, coordinates).

        Parameters
        ----------
        plant
            Components of the machine.
        sense
            Prediction from any initial state.
        """
        judged = self._judged
        if judged is None:
            return self.read(plant)
        return self._find(judged, plant, sense)[1]

    def near(self, plant: Plant, sense: Sense) -> InitialState:
        """Return the initial state with fits that begin at that of a machine.

        Fits of similar machines then take fewer predictions.

        Parameters
        ----------
        plant
            Components of the machine.
        sense
            Prediction of that machine from any initial state.
        """
        judged = self._judged
        if judged is None:
            return self
        swinging, fitted = self._find(judged, plant, sense)
        first, state = self._free(self.read(plant, swinging)), self._free(fitted)
        predict = self._from(fitted, judged.rows, sense, judged.ticks)
        slopes = find_slopes(predict, state, NEAR * judged.errors, predict(state)) / NEAR
        neighbour = Neighbour(swinging, (state - first) / judged.errors)
        other = copy(self)
        other._judged = replace(judged, slopes=slopes, neighbour=neighbour)
        return other

    def _find(self, judged: Judged, plant: Plant, sense: Sense) -> tuple[bool, Array]:
        """Fit the initial state.

        Returns whether the state as read is swinging, and the fitted state, shape
        (2, coordinates).
        """

        def miss(start: Array) -> Array:
            return sense(start, judged.ticks)[list(judged.rows)] - judged.measured

        neighbour = judged.neighbour
        if neighbour is not None:
            swinging, first = neighbour.swinging, self.read(plant, neighbour.swinging)
            begun = first.copy()
            moved = self._free(first) + neighbour.moved * judged.errors
            begun[:, : self.loose] = moved.reshape(2, -1)
            residual = miss(begun)
        else:
            # Without a position sensor, both guesses are tried: at rest in the MJCF, and swinging.
            guesses = (False, True) if self._unplaced[: self.loose].any() else (False,)
            starts = [self.read(plant, guess) for guess in guesses]
            misses = [miss(each) for each in starts]
            powers = [float(np.sum(np.mean(each**2, axis=1) / judged.held**2)) for each in misses]
            best = int(np.argmin(powers))
            swinging, first, residual = guesses[best], starts[best], misses[best]
            begun = first
        predict = self._from(begun, judged.rows, sense, judged.ticks)
        state = self._fit(judged, predict, self._free(first), self._free(begun), residual)
        fitted = begun.copy()
        fitted[:, : self.loose] = state.reshape(2, -1)
        return swinging, fitted

    def _fit(
        self,
        judged: Judged,
        predict: Callable[[Array], Array],
        first: Array,
        begun: Array,
        residual: Array,
    ) -> Array:
        """Fit the state of the free joints in several passes, shape (2 · free joints,).

        `first` is the state as read, and `residual` that of `begun`, shape (rows, ticks). A further
        pass takes the derivatives at the state that the last one found, as chaotic motion demands.
        """
        slopes, state, share = judged.slopes, begun, 1.0
        for _ in range(PASSES):
            rms = np.sqrt(np.mean(residual**2, axis=1))
            # A wrong model must not be blamed on the initial state: its residual widens the
            # tolerance.
            tolerance = np.repeat(np.maximum(judged.held, rms), judged.ticks)
            predicted = judged.measured.ravel() + residual.ravel()
            if share < 1.0:
                slopes = find_slopes(predict, state, share * judged.errors, predicted) / share
            state, predicted = fit_start(
                predict,
                judged.measured.ravel(),
                first,
                judged.errors,
                tolerance,
                slopes,
                predicted,
                state,
            )
            if np.all(rms <= CLOSE * judged.held):
                break
            residual = predicted.reshape(judged.measured.shape) - judged.measured
            after = np.sqrt(np.mean(residual**2, axis=1))
            share = float(np.max(after / np.maximum(rms, judged.held)))
            # Only a residual that falls much is one of the state, whose derivatives were too rough.
            if share > FALLS:
                break
        return state

    def _free(self, start: Array) -> Array:
        """Return positions and velocities of the free joints, shape (2 · free joints,)."""
        return start[:, : self.loose].ravel()

    def _respond(self, start: Array, sense: Sense, errors: Array, whole: Array) -> Array:
        """Return the change of all rows by each error, shape (all rows, ticks, unknowns)."""
        ticks = whole.shape[1]
        predict = self._from(start, range(len(whole)), sense, ticks)
        responses = find_slopes(predict, self._free(start), errors, whole.ravel())
        return responses.reshape(len(whole), ticks, -1)

    def _from(
        self, start: Array, rows: Sequence[int], sense: Sense, ticks: int
    ) -> Callable[[Array], Array]:
        """Return a function that predicts the rows, flattened, from a state of the free joints."""

        def predict(first: Array) -> Array:
            begin = start.copy()
            begin[:, : self.loose] = first.reshape(2, -1)
            return sense(begin, ticks)[list(rows)].ravel()

        return predict

    def _find_errors(self, rows: Sequence[Seen], noises: Sequence[float], ticks: int) -> Array:
        """Return standard errors of the state as read, shape (2 · free joints,)."""
        pairs = list(zip(rows, noises, strict=True))
        noise = max((level for seen, level in pairs if seen.kind == "position"), default=0.0)
        errors = np.repeat(np.array(start_error(noise, self._period, ticks)), self.loose)
        errors = errors.reshape(2, -1)
        for seen, level in pairs:
            for joint in np.nonzero(seen.along[: self.loose])[0]:
                if seen.kind == "velocity" and self._unplaced[joint]:
                    size = abs(float(seen.along[joint]))
                    errors[0, joint] = guess_place(seen.measured, self._period)[1] / size
                    errors[1, joint] = ERRORS * level / size
        # A joint that no sensor sees gets the largest error of all.
        return np.where(errors > 0.0, errors, np.max(errors, axis=1, keepdims=True)).ravel()
