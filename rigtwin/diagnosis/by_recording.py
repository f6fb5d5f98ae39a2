"""What each of several recordings asks of a machine's parameters: least squares to first order
about one plant a recording, some parameters in common to all, others each recording's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import JUMPS, SPIKE, Evidence, despike
from rigtwin.diagnosis.space import PRIOR
from rigtwin.numerics.arrays import Array

BLOCKS = 10
"""Stretches of each recording that are left out in turn."""
RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it."""


@dataclass(frozen=True)
class Column:
    """One parameter that may be off. kind: `effect`, one that physics has; `zero`, of a sensor;
    `tolerance`, in half widths; step: of its derivative, in its unit; others: values of
    the effect's other parameters where it is not in the plant yet."""

    kind: str
    group: str
    parameter: str
    step: float
    effect: Effect | None = None
    others: tuple[tuple[str, float], ...] = ()

    def moved(self, plant: Plant, amount: float) -> Plant:
        """The plant with this parameter higher by that many steps, within its bounds."""
        part = getattr(plant, self.group)
        value = float(getattr(part, self.parameter)) + amount * self.step
        if self.effect is not None:
            own = self.effect.quantities()[self.parameter]
            value = min(max(value, own.low), own.high)
        changed = part._replace(**{self.parameter: value, **dict(self.others)})
        return plant._replace(**{self.group: changed})


@dataclass(frozen=True)
class Estimate:
    """Of one parameter in each recording. moves, widths: steps from the plants, and their standard
    errors, shape (recordings,); common: steps of the parameters in common; left: χ² that stays,
    in units of what the plants leave."""

    moves: Array
    widths: Array
    common: Array
    left: float


@dataclass(frozen=True)
class ByRecording:
    """Normal equations of each stretch of each recording.

    normal: shape (recordings, blocks, columns, columns); gradient: of a descent, shape
    (recordings, blocks, columns); power: of what the plants leave, shape (recordings, blocks);
    pieces: independent ones that it consists of, shape (recordings,).
    """

    columns: tuple[Column, ...]
    normal: Array
    gradient: Array
    power: Array
    pieces: Array

    @classmethod
    def at(
        cls,
        evidence: Evidence,
        plants: Sequence[Plant],
        columns: Sequence[Column],
        relative: bool = True,
    ) -> ByRecording:
        """About one plant a recording.

        Parameters
        ----------
        evidence
            The recordings.
        plants
            One each.
        columns
            Parameters that may be off.
        relative
            Whether χ² is in units of what each plant leaves, so that a rough model's error is no
            evidence; or of what its signals are held to.

        Returns
        -------
        ByRecording
            To first order.
        """
        found = [
            _equations(evidence, number, plant, columns, relative)
            for number, plant in enumerate(plants)
        ]
        normal, gradient, power, pieces = (np.stack(each) for each in zip(*found, strict=True))
        return cls(tuple(columns), normal, gradient, power, pieces)

    @property
    def total(self) -> float:
        """χ² of what the plants leave."""
        return float(self.power.sum())

    def seen(self, number: int, free: Sequence[int]) -> Array:
        """How much of a column's response others cannot take up, as a share of it, of each
        recording; 0 where it does nothing.

        Parameters
        ----------
        number
            Of the column.
        free
            Of the others.

        Returns
        -------
        array
            0 to 1, shape (recordings,).
        """
        rest = [other for other in free if other != number]
        shares = []
        for whole in self.normal.sum(axis=1):
            own = whole[number, number]
            inner = whole[np.ix_(rest, rest)] + self._prior(rest, whole)
            taken = whole[rest, number] @ np.linalg.solve(inner, whole[rest, number])
            shares.append(max(own - taken, 0.0) / own if own > 0.0 else 0.0)
        return np.array(shares)

    def estimate(self, tested: int | None, common: Sequence[int], own: Sequence[int]) -> Estimate:
        """A parameter of each recording alone.

        Parameters
        ----------
        tested
            Column that each recording may have another value of, None for none.
        common
            Columns that all have one value of.
        own
            Columns that are each recording's own without anybody asking: zeros, tolerances.

        Returns
        -------
        Estimate
            With standard errors by the jackknife over stretches, or those of independent pieces
            where these are wider.
        """
        whole, right = self.normal.sum(axis=1), self.gradient.sum(axis=1)
        kept = [*common] if tested is None else [*common, tested]
        # Without any move nuisances take up something too.
        parts = [self._reduce(n, g, kept, own) for n, g in zip(whole, right, strict=True)]
        moves, shared, gained = _assemble(parts, len(common))
        left = self.total - gained
        if tested is None:
            return Estimate(moves, np.zeros(len(parts)), shared, left)
        formal = []
        for number, (inner, _, _) in enumerate(parts):
            share = float(self.power[number].sum())
            information = max(inner[-1, -1], 1e-300)
            formal.append(
                share * left / max(self.total, 1e-300) / self.pieces[number] / information
            )
        return Estimate(
            moves,
            np.maximum(np.sqrt(np.array(formal)), self._jackknife(parts, kept, own, len(common))),
            shared,
            left,
        )

    def _jackknife(
        self,
        parts: list[tuple[Array, Array, float]],
        kept: Sequence[int],
        own: Sequence[int],
        common: int,
    ) -> Array:
        spread = np.zeros(len(parts))
        blocks = self.normal.shape[1]
        for number in range(len(parts)):
            rest = []
            for block in range(blocks):
                left = np.arange(blocks) != block
                part = self._reduce(
                    self.normal[number, left].sum(axis=0),
                    self.gradient[number, left].sum(axis=0),
                    kept,
                    own,
                )
                changed = [*parts[:number], part, *parts[number + 1 :]]
                rest.append(_assemble(changed, common)[0])
            moved = np.stack(rest)
            spread += (blocks - 1) / blocks * np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
        return np.sqrt(spread)

    def _prior(self, numbers: Sequence[int], whole: Array) -> Array:
        """What moving these columns costs: a tolerance its prior, others next to nothing."""
        costs = [
            PRIOR
            if self.columns[number].kind == "tolerance"
            else RIDGE * whole[number, number] + 1e-12
            for number in numbers
        ]
        return np.diag(np.array(costs)) if costs else np.zeros((0, 0))

    def _reduce(
        self, whole: Array, right: Array, kept: Sequence[int], own: Sequence[int]
    ) -> tuple[Array, Array, float]:
        """Normal matrix and gradient of the columns that are kept, with a recording's own taken
        out, and the χ² that these gain."""
        inner = whole[np.ix_(own, own)] + self._prior(own, whole)
        cross = whole[np.ix_(own, kept)]
        solved = np.linalg.solve(inner, np.column_stack([cross, right[own]]))
        normal = whole[np.ix_(kept, kept)] - cross.T @ solved[:, :-1]
        return (
            normal + self._prior(kept, whole),
            right[kept] - cross.T @ solved[:, -1],
            float(right[own] @ solved[:, -1]),
        )


def _assemble(
    parts: Sequence[tuple[Array, Array, float]], common: int
) -> tuple[Array, Array, float]:
    """Solves for the parameters in common and each recording's own: the latter, the former, and
    the χ² gained."""
    shared, right = np.zeros((common, common)), np.zeros(common)
    tested = len(parts[0][1]) > common
    gained = 0.0
    for normal, gradient, taken in parts:
        cross, own = normal[:common, common:], normal[common:, common:]
        shared += normal[:common, :common]
        right += gradient[:common]
        gained += taken
        if tested:
            shared -= cross @ cross.T / own[0, 0]
            right -= cross[:, 0] * gradient[common] / own[0, 0]
            gained += float(gradient[common] ** 2 / own[0, 0])
    values = np.linalg.lstsq(shared, right, rcond=1e-12)[0] if common else np.zeros(0)
    gained += float(right @ values)
    moves = np.array(
        [
            (gradient[common] - normal[common, :common] @ values) / normal[common, common]
            if tested
            else 0.0
            for normal, gradient, _ in parts
        ]
    )
    return moves, values, gained


def differences_of(evidence: Evidence, number: int, plant: Plant) -> Array:
    """Measured less predicted of one recording, spikes apart, shape (rows, ticks)."""
    lines = evidence.lines[number]
    difference = lines.measured - evidence.models[number].predict(plant)
    for row, meaning in enumerate(evidence.machine.rows):
        if meaning.kind in JUMPS:
            despike(difference[row], SPIKE * float(lines.noise[row]))
    return difference


def _equations(
    evidence: Evidence, number: int, plant: Plant, columns: Sequence[Column], relative: bool
) -> tuple[Array, Array, Array, float]:
    lines = evidence.lines[number]
    forms = np.array([evidence.machine.form_of(row) for row in evidence.machine.rows])
    scale = np.sqrt(lines.noise**2 + (forms * np.std(lines.measured, axis=1)) ** 2)
    weight = lines.fade / scale[:, None]
    here = weight * differences_of(evidence, number, plant)
    jacobian = []
    for column in columns:
        sign = 1.0
        there = column.moved(plant, sign)
        value = float(getattr(getattr(there, column.group), column.parameter))
        reached = value - float(getattr(getattr(plant, column.group), column.parameter))
        if abs(reached) < 0.5 * abs(column.step):
            sign, there = -1.0, column.moved(plant, -1.0)
        jacobian.append(sign * (here - weight * differences_of(evidence, number, there)))
    unit = max(float(np.sqrt(np.mean(here**2))), 1e-300) if relative else 1.0
    flat = np.stack([*jacobian, here]) / unit
    cuts = np.linspace(0, flat.shape[2], BLOCKS + 1).astype(int)
    products = np.stack(
        [
            (part := flat[:, :, low:high].reshape(len(flat), -1)) @ part.T
            for low, high in pairwise(cuts)
        ]
    )
    return (
        products[:, :-1, :-1],
        products[:, :-1, -1],
        products[:, -1, -1],
        _count_independent(here),
    )


def _count_independent(left: Array) -> float:
    """How many independent pieces a difference consists of: the lines that share its power,
    twice; shape (rows, ticks)."""
    power = np.abs(np.fft.rfft(left, axis=1)) ** 2
    return max(4.0 * float(power.sum()) ** 2 / max(float((power**2).sum()), 1e-300), 4.0)
