"""Where joints that act on each other are and how fast they go when a recording starts, by the
sensors that see them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.models.joint_start import FORGOTTEN, SHOWS, guess_place
from rigtwin.models.start import ERRORS, LIKELY, find_slopes, fit_start, read_start, start_error
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import smallest_step, white_noise

FIRMNESS, CLOSELY = 1e-3, 10.0
"""Weights of where the MJCF has a joint and of a velocity that is measured, against a sensor of the
position and its slope."""
Sense = Callable[[Array, int], Array]
"""What is observed, shape (rows, ticks), from a start of shape (2, coordinates) and for so many
ticks."""


@dataclass(frozen=True)
class Seen:
    """A sensor that sees joints. kind: position or velocity; along: coordinates that it adds up,
    shape (coordinates,); zero: of that sum where the MJCF has it; measured: shape (ticks,)."""

    kind: str
    along: Array
    zero: float
    measured: Array


@dataclass(frozen=True)
class Judged:
    """How a start is fitted. rows: to which of those observed; held: to what each is predicted at
    best; errors: of the start as it is read, shape (2 · free joints,); slopes: of the rows by each
    error, of the nominal machine: near enough for others; ticks: for which it is remembered;
    responses: what each error changes in all rows, shape (all rows, all ticks, errors)."""

    rows: tuple[int, ...]
    measured: Array
    held: Array
    errors: Array
    slopes: Array
    ticks: int
    responses: Array


class InitialState:
    """Read from sensors; fitted where an error of it shows."""

    def __init__(self, seen: Mapping[str, Seen], place: Array, loose: int, period: float) -> None:
        """place: where the MJCF has the coordinates; loose: of which so many, the first, are free;
        period: s."""
        self._seen, self._place, self._loose, self._period = dict(seen), place, loose, period
        self._judged: Judged | None = None
        placed = [each.along for each in self._seen.values() if each.kind == "position"]
        self._unplaced = ~np.any(np.array(placed).reshape(-1, len(place)) != 0.0, axis=0)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Components that it is read from."""
        return tuple(self._seen)

    @property
    def fitted(self) -> bool:
        """Whether the error of a start shows."""
        return self._judged is not None

    def read(self, plant: Plant, swinging: bool = False) -> Array:
        """Positions and velocities as the first samples have them, shape (2, coordinates). A joint
        that no sensor sees is where the MJCF has it, at rest; one whose velocity alone is seen is
        there too, or, if `swinging`, where it is about the middle of its swing."""
        firm = FIRMNESS * np.eye(len(self._place))
        places: list[Array] = [firm]
        rates: list[Array] = [firm]
        there: list[Array] = [FIRMNESS * self._place]
        speeds: list[Array] = [np.zeros(len(self._place))]
        for name, each in self._seen.items():
            sensor = getattr(plant, name)
            value, slope = read_start(each.measured, self._period)
            value = (value - sensor.offset) / sensor.gain
            if each.kind == "position":
                places.append(each.along[None])
                there.append(np.array([value - each.zero]))
                rates.append(each.along[None])
                speeds.append(np.array([(slope - sensor.drift) / sensor.gain]))
                continue
            rates.append(CLOSELY * each.along[None])
            speeds.append(np.array([CLOSELY * value]))
            if swinging and np.all(self._unplaced[each.along != 0.0]):
                place, _ = guess_place(each.measured, self._period)
                places.append(each.along[None])
                there.append(np.array([place / sensor.gain]))
        start = [
            np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
            for rows, values in ((places, there), (rates, speeds))
        ]
        return np.array(start, np.float64, order="C")

    def judge(self, plant: Plant, rows: Mapping[int, tuple[Seen, float]], sense: Sense) -> None:
        """Find whether the error of a start as it is read shows, and for how long.

        Parameters
        ----------
        plant
            The machine as told.
        rows
            Number of a row observed → its sensor, and the error of the machine's form as a share of
            what it reads; those of positions and velocities.
        sense
            The machine from any start.
        """
        if not rows:
            return
        noises = [
            max(white_noise(each.measured), smallest_step(each.measured) / np.sqrt(12.0))
            for each, _ in rows.values()
        ]
        held = np.array(
            [
                max(form * float(np.std(each.measured)), noise, 1e-300)
                for (each, form), noise in zip(rows.values(), noises, strict=True)
            ]
        )
        ticks = len(next(iter(rows.values()))[0].measured)
        errors = self._find_errors([each for each, _ in rows.values()], noises, ticks)
        start, numbers = self.read(plant), list(rows)
        whole = sense(start, ticks)
        every_row = range(len(whole))
        predict, first = self._from(start, every_row, sense, ticks), self._free(start)
        responses = find_slopes(predict, first, errors, whole.ravel())
        responses = responses.reshape(len(whole), ticks, -1)
        by_row = responses[numbers]
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

    @property
    def linear(self) -> bool:
        """Whether `correct` may stand for `find`: a joint whose place no sensor sees may start far
        from where it is read."""
        return not self._unplaced[: self._loose].any()

    def correct(self, predicted: Array) -> Array:
        """Add what errors of the start change in a prediction that begins where it is read.

        The errors are linear nuisance parameters θ with a prior of LIKELY standard errors: with S
        the responses and r the residual, θ = (Sᵀ S + I / LIKELY²)⁻¹ Sᵀ r. One integration instead
        of several, good enough to search by.

        Parameters
        ----------
        predicted
            Prediction of all rows, shape (rows, ticks).

        Returns
        -------
        array
            Shape (rows, ticks).
        """
        judged = self._judged
        if judged is None:
            return predicted
        residual = judged.measured - predicted[list(judged.rows), : judged.ticks]
        # A model that is far off elsewhere too is no reason to start otherwise.
        held = np.maximum(judged.held, np.sqrt(np.mean(residual**2, axis=1)))
        columns = judged.slopes / np.repeat(held, judged.ticks)[:, None]
        normal = columns.T @ columns + np.eye(columns.shape[1]) / LIKELY**2
        errors = np.linalg.solve(normal, columns.T @ (residual / held[:, None]).ravel())
        return predicted + judged.responses @ errors

    def find(self, plant: Plant, sense: Sense) -> Array:
        """The start as the sensors have it, shape (2, coordinates).

        Parameters
        ----------
        plant
            The machine.
        sense
            It from any start.
        """
        start, judged = self.read(plant), self._judged
        if judged is None:
            return start

        def miss(start: Array) -> Array:
            return sense(start, judged.ticks)[list(judged.rows)] - judged.measured

        starts = [start]
        if self._unplaced[: self._loose].any():
            starts.append(self.read(plant, swinging=True))
        misses = [miss(each) for each in starts]
        powers = [float(np.sum(np.mean(each**2, axis=1) / judged.held**2)) for each in misses]
        best = int(np.argmin(powers))
        start, first = starts[best], misses[best]
        # A model that is far off elsewhere too is no reason to start otherwise.
        left = np.sqrt(np.mean(first**2, axis=1))
        found = fit_start(
            self._from(start, judged.rows, sense, judged.ticks),
            judged.measured.ravel(),
            self._free(start),
            judged.errors,
            np.repeat(np.maximum(judged.held, left), judged.ticks),
            judged.slopes,
            judged.measured.ravel() + first.ravel(),
        )
        fitted = start.copy()
        fitted[:, : self._loose] = found.reshape(2, -1)
        return fitted

    def _free(self, start: Array) -> Array:
        """Positions and velocities of what is free, shape (2 · free joints,)."""
        return start[:, : self._loose].ravel()

    def _from(
        self, start: Array, rows: Sequence[int], sense: Sense, ticks: int
    ) -> Callable[[Array], Array]:
        """Rows, one after another, from any start of what is free."""

        def predict(first: Array) -> Array:
            begin = start.copy()
            begin[:, : self._loose] = first.reshape(2, -1)
            return sense(begin, ticks)[list(rows)].ravel()

        return predict

    def _find_errors(self, rows: Sequence[Seen], noises: Sequence[float], ticks: int) -> Array:
        """Of the start as it is read, positions and velocities, shape (2 · free joints,)."""
        pairs = list(zip(rows, noises, strict=True))
        noise = max((own for each, own in pairs if each.kind == "position"), default=0.0)
        errors = np.repeat(np.array(start_error(noise, self._period, ticks)), self._loose)
        errors = errors.reshape(2, -1)
        for each, own in pairs:
            for joint in np.nonzero(each.along[: self._loose])[0]:
                if each.kind == "velocity" and self._unplaced[joint]:
                    size = abs(float(each.along[joint]))
                    errors[0, joint] = guess_place(each.measured, self._period)[1] / size
                    errors[1, joint] = ERRORS * own / size
        # What no row of these sees is known as badly as the rest.
        return np.where(errors > 0.0, errors, np.max(errors, axis=1, keepdims=True)).ravel()
