"""Windows of a recording, each predicted from an initial state of its own.

An unstable or chaotic machine forgets its past: two simulations whose initial states differ by less
than the sensors resolve soon have nothing in common. A prediction of the whole recording then says
nothing about the model. The recording is therefore cut in half until no initial error grows beyond
`GROWN` within a window, as in multiple shooting [Bock, Recent advances in parameter identification
techniques for ODE, in: Numerical Treatment of Inverse Problems (1983) 95].
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.models.initial_state import InitialState
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.memo import Memo

GROWN = 15.0
"""Largest growth of an initial error within a window. A pendulum that swings regularly reaches 10
within tens of periods; chaos multiplies errors by e several times a second, and beyond this growth
a fitted state depends on its data too nonlinearly."""
STEADY = 1.5
"""Growth up to which an initial error is corrected once."""
SHORTEST, FEWEST = 0.15, 40
"""Shortest window: time, s, and number of ticks. Each window costs two unknowns per joint."""


Sense = Callable[[Array, int, int], Array]
"""Function of an initial state, shape (2, coordinates), a first tick, and the tick after the last.
It returns the predicted rows, shape (rows, ticks)."""


@dataclass(frozen=True)
class Window:
    """Part of a recording that is predicted from one initial state.

    Attributes
    ----------
    first, last : int
        First tick, and the tick after the last.
    state : InitialState
        Initial state, read from the sensors at `first` and later.
    """

    first: int
    last: int
    state: InitialState

    @property
    def ticks(self) -> int:
        """Length of the window."""
        return self.last - self.first


def divide(
    first: int, last: int, period: float, judge: Callable[[int, int], InitialState]
) -> tuple[Window, ...]:
    """Divide a recording into windows within which no initial error grows much.

    Parameters
    ----------
    first, last
        First tick, and the tick after the last.
    period
        Time from tick to tick, s.
    judge
        Function that judges the initial state of a window, from its first and last ticks.

    Returns
    -------
    tuple of Window
        Windows without gaps, in order of time. One where the machine remembers its start.
    """
    window = Window(first, last, judge(first, last))
    least = max(FEWEST, round(SHORTEST / period))
    if window.state.growth <= GROWN or window.ticks < 2 * least:
        return (window,)
    middle = (first + last) // 2
    halves = ((first, middle), (middle, last))
    return tuple(part for half in halves for part in divide(*half, period, judge))


class WindowStarts:
    """Initial states from which the windows of a recording are predicted.

    Parameters
    ----------
    windows
        Windows of the recording, in order of time.
    linear
        Whether errors of the initial states are linear nuisance parameters, by which predictions
        are corrected. They are fitted otherwise.
    remembered
        Number of plants whose initial states are kept.

    Attributes
    ----------
    windows : tuple of Window
        Windows of the recording, in order of time.
    linear : bool
        Whether predictions have to be corrected.
    """

    def __init__(self, windows: tuple[Window, ...], linear: bool, remembered: int) -> None:
        self.windows, self.linear = windows, linear
        self._found: Memo[Array] = Memo(remembered)
        self._moved: Memo[tuple[Array, Array]] = Memo(remembered)

    @property
    def may_be_linear(self) -> bool:
        """Whether predictions can be corrected for errors of the initial states, and have to be."""
        states = [window.state for window in self.windows]
        return any(state.fitted for state in states) and all(state.linear for state in states)

    def of(self, plant: Plant, key: Hashable, sense: Sense) -> Array:
        """Return the initial states of all windows, m and m/s, shape (windows, 2, coordinates).

        Parameters
        ----------
        plant
            Components of the machine.
        key
            Key of everything that the motion depends on.
        sense
            Prediction from any initial state.
        """
        if not any(window.state.fitted for window in self.windows):
            return self._read(plant)
        if self.linear:
            return self._move(plant, key, sense)[0]
        return self._found.recall(key, lambda: self._find(plant, sense))

    def near(self, plant: Plant, sense: Sense) -> tuple[Window, ...]:
        """Return the windows with fits of their initial states that begin at those of a machine.

        Parameters
        ----------
        plant
            Components of the machine.
        sense
            Prediction of that machine from any initial state.
        """
        return tuple(
            replace(window, state=window.state.near(plant, _from(sense, window)))
            for window in self.windows
        )

    def correct(self, plant: Plant, key: Hashable, sense: Sense, predicted: Array) -> Array:
        """Correct a prediction for errors of all initial states, to first order.

        Parameters
        ----------
        plant, key, sense
            Machine, as for `of`.
        predicted
            Prediction from these initial states, shape (rows, ticks).

        Returns
        -------
        array
            Corrected prediction, shape (rows, ticks). It is the prediction itself where the states
            are fitted.
        """
        if not self.linear:
            return predicted
        corrected = predicted.copy()
        moved = self._move(plant, key, sense)[1]
        for window, errors in zip(self.windows, moved, strict=True):
            part = slice(window.first, window.last)
            corrected[:, part] = window.state.correct(predicted[:, part], errors)
        return corrected

    def _read(self, plant: Plant) -> Array:
        """Return the initial states as read, shape (windows, 2, coordinates)."""
        return np.stack([window.state.read(plant) for window in self.windows])

    def _find(self, plant: Plant, sense: Sense) -> Array:
        """Return the fitted initial states, shape (windows, 2, coordinates)."""
        return np.stack([window.state.find(plant, _from(sense, window)) for window in self.windows])

    def _move(self, plant: Plant, key: Hashable, sense: Sense) -> tuple[Array, Array]:
        """Return the states that a prediction starts from, and how far they are from those read.

        The distances are in standard errors, shape (windows, unknowns). A single window whose
        errors do not grow is predicted from its state as read. Where they grow, one correction to
        first order leaves an error that an effect would explain: so the states are moved by a first
        correction, and the prediction from there is corrected again.
        """
        if len(self.windows) == 1 and self.windows[0].state.growth <= STEADY:
            return self._read(plant), np.zeros((1, 2 * self.windows[0].state.loose))

        def move() -> tuple[Array, Array]:
            moved = [
                window.state.move(plant, sense(window.state.read(plant), window.first, window.last))
                for window in self.windows
            ]
            return np.stack([state for state, _ in moved]), np.stack([by for _, by in moved])

        return self._moved.recall(key, move)


def _from(sense: Sense, window: Window) -> Callable[[Array, int], Array]:
    """Return the prediction from an initial state, and for a number of ticks, of a window."""
    return lambda start, ticks: sense(start, window.first, window.first + ticks)
