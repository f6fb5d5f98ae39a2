"""Windows of a recording, each predicted from an initial state of its own.

An unstable or chaotic machine forgets its past: two simulations whose initial states differ by less
than the sensors resolve soon have nothing in common. A prediction of the whole recording then says
nothing about the model. The recording is therefore cut in half until no initial error grows beyond
`GROWN` within a window, as in multiple shooting [Bock, Recent advances in parameter identification
techniques for ODE, in: Numerical Treatment of Inverse Problems (1983) 95].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rigtwin.models.initial_state import InitialState
from rigtwin.numerics.arrays import Array

GROWN = 15.0
"""Largest growth of an initial error within a window. A pendulum that swings regularly reaches 10
within tens of periods; chaos multiplies errors by e several times a second, and beyond this growth
a fitted state depends on its data too nonlinearly."""
SHORTEST, FEWEST = 0.5, 40
"""Shortest window: time, s, and number of ticks. Each window costs two unknowns per joint."""


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


def correct_each(windows: Sequence[Window], predicted: Array, moved: Array) -> Array:
    """Correct a prediction for errors of all initial states, to first order.

    Parameters
    ----------
    windows
        Windows of the recording.
    predicted
        Prediction, shape (rows, ticks).
    moved
        Standard errors by which each window's initial state differs from the state as read, shape
        (windows, unknowns).

    Returns
    -------
    array
        Corrected prediction, shape (rows, ticks).
    """
    corrected = predicted.copy()
    for window, by in zip(windows, moved, strict=True):
        part = slice(window.first, window.last)
        corrected[:, part] = window.state.correct(predicted[:, part], by)
    return corrected
