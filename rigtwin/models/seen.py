"""What sensors show of an initial state: their signals, and what a fit of the state needs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Seen:
    """Sensor that sees coordinates.

    Attributes
    ----------
    kind : str
        Measured quantity: `position` or `velocity`.
    along : Array
        Direction of the sensor in the coordinates, shape (coordinates,).
    zero : float
        Position of the sensor at zero coordinates, m.
    measured : Array
        Signal of the sensor, shape (ticks,).
    noise : float
        Standard deviation of a sample.
    earlier : Array
        Signal before the first tick, shape (earlier ticks,).
    """

    kind: str
    along: Array
    zero: float
    measured: Array
    noise: float
    earlier: Array = field(default_factory=lambda: np.empty(0))

    def between(self, first: int, last: int) -> Seen:
        """Return the sensor with the part of its signal between two ticks."""
        return replace(self, measured=self.measured[first:last], earlier=self.measured[:first])


@dataclass(frozen=True)
class Neighbour:
    """Fitted initial state of a similar machine, from which the fits of others begin.

    Attributes
    ----------
    swinging : bool
        Argument of `InitialState.read` that gives the state as read.
    moved : Array
        Difference from the state as read, in standard errors, shape (unknowns,).
    """

    swinging: bool
    moved: Array


@dataclass(frozen=True)
class Judged:
    """Data by which an initial state is fitted.

    Attributes
    ----------
    rows : tuple of int
        Indices of the observed rows to which the state is fitted.
    measured : Array
        Measured signals of these rows, shape (rows, ticks).
    held : Array
        Standard deviation to which each row can be predicted at best, shape (rows,).
    errors : Array
        Standard errors of the state as read, shape (2 · free joints,).
    slopes : Array
        Change of the rows by one standard error of each unknown, shape (rows · ticks, unknowns).
        They are those of the nominal machine, or of the neighbour, and serve for all candidates.
    ticks : int
        Ticks for which the machine remembers its initial state.
    responses : Array
        Change of all rows by each error, shape (all rows, all ticks, unknowns).
    neighbour : Neighbour or None
        State from which a fit begins; None for the state as read.
    """

    rows: tuple[int, ...]
    measured: Array
    held: Array
    errors: Array
    slopes: Array
    ticks: int
    responses: Array
    neighbour: Neighbour | None = None

    @cached_property
    def squares(self) -> Array:
        """Sᵀ S of each row's slopes S, shape (rows, unknowns, unknowns)."""
        by_row = self.slopes.reshape(len(self.rows), self.ticks, -1)
        return np.matmul(by_row.transpose(0, 2, 1), by_row)
