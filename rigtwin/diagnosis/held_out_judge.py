"""How an explanation does on stretches of the recordings that its values were not taken from: every
recording counts alike, whatever its noise or length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, Values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.ranking import CONTAINED
from rigtwin.diagnosis.thresholds import SelectionRules
from rigtwin.numerics.arrays import Array

Ticks = NDArray[np.bool_]
"""Which of a recording's ticks are meant."""
FOLDS = 4
"""Stretches that are held out in turn, if there are fewer recordings than that."""
BLOCKS = 40
"""Of each recording, over which differences between explanations are averaged."""
RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it."""
STEPS = (1.0, 0.4, 0.0)
"""Shares of the step to a fold's own values that are tried."""
DOUBT = 0.5
"""Parameters that a kind costs besides its own if a simpler one may look like it and has as
many."""
WIDE = 5.0
"""Times the steps of the derivatives at which responses are compared again."""


@dataclass(frozen=True)
class Judged:
    """An explanation, and how it does on data held out of its fit.

    power: of what is left in each block, in units of the signals' own, shape (recordings, blocks);
    widths: standard errors of its values by the jackknife over stretches of the recordings; floor:
    error below which no model is better than another; pieces: independent ones that what is left
    consists of; size: number of parameters, and of bits that say which of the places looked at they
    were found from; cancels: whether two of its effects undo each other; collinear: whether the
    responses of two can hardly be told apart;
    bounded: whether a value stands at the end of the range that it is searched in; complete:
    whether it leaves nothing but noise.
    """

    fit: Fit
    power: Array = field(repr=False)
    widths: Values = field(default=(), repr=False)
    floor: float = 1e-12
    pieces: float = math.e
    size: float = 0.0
    cancels: bool = False
    collinear: bool = False
    bounded: bool = False
    complete: bool = False

    @property
    def errors(self) -> Array:
        """rms of what is left, in units of the signals' own, of each recording."""
        return np.sqrt(np.mean(self.power, axis=1))

    @property
    def doubtful(self) -> bool:
        """Whether two of its effects undo each other, or can hardly be told apart."""
        return self.cancels or self.collinear

    @property
    def score(self) -> float:
        """Logarithm of the error, averaged over the recordings: the lower the better."""
        return float(0.5 * np.mean(np.log(self.errors**2 + self.floor**2)))

    def uncertainty_against(self, other: Judged) -> float:
        """Standard error of the difference of two scores, from how it is spread over blocks."""
        total = 0.0
        for own, foreign in zip(self.power, other.power, strict=True):
            one, two = max(float(own.mean()), 1e-24), max(float(foreign.mean()), 1e-24)
            change = own / one - foreign / two
            total += 0.25 * float(np.mean(change**2)) / max(len(own) - 1, 1)
        return math.sqrt(total) / len(self.power)

    def beside(self, errors: Array) -> Judged:
        """The same, judged on further recordings too, shape (recordings,): what it leaves of each,
        in units of the signals' own."""
        blocks = np.tile(np.square(errors)[:, None], (1, self.power.shape[1]))
        return replace(self, power=np.concatenate([self.power, blocks]))

    def is_stable(self, nominal: Sequence[float], least: float) -> bool:
        """Whether the magnitude of each effect is off nominal by that many standard errors."""
        return all(
            abs(values[0] - there) >= least * widths[0]
            for values, widths, there in zip(self.fit.values, self.widths, nominal, strict=True)
        )


class HeldOutJudge:
    """Judges fits on folds of one body of evidence that are held out in turn."""

    def __init__(self, fitter: Fitter, rules: SelectionRules) -> None:
        self.fitter, self.rules = fitter, rules
        evidence = fitter.evidence
        self._scales = []
        for each in evidence.lines:
            form = np.array([evidence.machine.form_of(row) for row in evidence.machine.rows])
            swing = np.std(each.measured, axis=1)
            self._scales.append(np.sqrt(each.noise**2 + (form * swing) ** 2))
        self._own = np.array(
            [
                float(np.mean((np.std(each.measured, axis=1) / scale) ** 2))
                for each, scale in zip(evidence.lines, self._scales, strict=True)
            ]
        )
        forms = [evidence.machine.form_of(row) for row in evidence.machine.rows]
        # Below what no model is held to an error counts no more.
        self._floor = float(np.sqrt(np.mean(np.square(forms))))
        self._folds, self._pieces = _folds(evidence), _stretches(evidence)
        self._blocks = [
            np.minimum(np.arange(ticks) * BLOCKS // ticks, BLOCKS - 1) for ticks in _ticks(evidence)
        ]
        self._judged: dict[frozenset[Effect], Judged] = {}

    def cost(self, fit: Fit) -> float:
        """Score of a fit with a price on its parameters."""
        judged = self.judge(fit)
        return judged.score + self.rules.price_of(judged.pieces) * judged.size

    def judge(self, fit: Fit) -> Judged:
        """How a fit does on data that are held out of it.

        Parameters
        ----------
        fit
            To all the evidence.

        Returns
        -------
        Judged
            Its values are moved to those of the rest for each fold by a Gauss-Newton step.
        """
        known = frozenset(fit.effects)
        if known not in self._judged or self._judged[known].fit.misfit > fit.misfit:
            self._judged[known] = self._judge(fit)
        return self._judged[known]

    def _judge(self, fit: Fit) -> Judged:
        evidence, plant = self.fitter.evidence, self.fitter.plant
        here = self._scaled(evidence.differences(fit.plant))
        if not fit.effects:
            return Judged(
                fit, self._power(here), floor=self._floor, pieces=count_independent(evidence, fit)
            )
        jacobian, steps = self._jacobian(fit, here)
        low, high = self.fitter.bounds(fit.effects)
        start = np.concatenate([np.asarray(values) for values in fit.values])
        left = [each.copy() for each in here]
        for held in self._folds:
            move = self._move(jacobian, here, held) * steps
            best, there = math.inf, here
            for share in STEPS:
                values = np.clip(start + share * move, low, high)
                tried = (
                    here
                    if share == 0.0
                    else self._scaled(
                        evidence.differences(
                            with_values(plant, fit.effects, _split(values, fit.effects))
                        )
                    )
                )
                inside = sum(
                    float(np.sum(t[:, ~out] ** 2)) for t, out in zip(tried, held, strict=True)
                )
                if inside < best:
                    best, there = inside, tried
                if share == 1.0 and inside <= self._inside(here, held):
                    break
            for own, foreign, out in zip(left, there, held, strict=True):
                own[:, out] = foreign[:, out]
        widths = self._jackknife(jacobian, here) * steps
        return Judged(
            fit=fit,
            power=self._power(left),
            widths=_split(widths, fit.effects),
            floor=self._floor,
            pieces=count_independent(evidence, fit),
            size=float(sum(self._size(effect) for effect in fit.effects)),
            cancels=self._cancels(fit),
            collinear=self._are_collinear(fit, jacobian, here, widths),
            bounded=self.fitter.is_bounded(fit),
            complete=fit.misfit
            <= (1.0 + self.rules.complete) * evidence.expected_misfit(fit.plant),
        )

    def _size(self, effect: Effect) -> float:
        starts, count = self.fitter.starts(effect), len(effect.kind.parameters)
        if starts.quadrature:
            # Of a wave each pitch is a place of its own, looked at in two phases.
            return count + math.log2(len(starts.values) / 2)
        return count + (DOUBT if count == 1 and effect.kind.name in CONTAINED else 0.0)

    def _jackknife(self, jacobian: Sequence[Array], here: Sequence[Array]) -> Array:
        """Standard errors in units of the steps: how far the values move, to first order, when one
        stretch after another is left out."""
        moves = np.stack([self._move(jacobian, here, held) for held in self._pieces])
        spread = np.sum((moves - moves.mean(axis=0)) ** 2, axis=0)
        return np.sqrt((len(moves) - 1) / len(moves) * spread)

    @staticmethod
    def _inside(differences: Sequence[Array], held: Sequence[Ticks]) -> float:
        return sum(
            float(np.sum(each[:, ~out] ** 2)) for each, out in zip(differences, held, strict=True)
        )

    def _scaled(self, differences: Sequence[Array]) -> list[Array]:
        """Differences in units of what a signal is held to, faded in."""
        return [
            each.fade * difference / scale[:, None]
            for each, difference, scale in zip(
                self.fitter.evidence.lines, differences, self._scales, strict=True
            )
        ]

    def _jacobian(
        self, fit: Fit, here: Sequence[Array], wide: float = 1.0
    ) -> tuple[list[Array], Array]:
        """What a step of each parameter changes, shape (parameters, rows, ticks) a recording."""
        steps = wide * np.concatenate([self.fitter.starts(effect).steps for effect in fit.effects])
        _, high = self.fitter.bounds(fit.effects)
        values = np.concatenate([np.asarray(each) for each in fit.values])
        columns: list[list[Array]] = []
        for number, step in enumerate(steps):
            beside = values.copy()
            sign = 1.0 if beside[number] + step <= high[number] else -1.0
            beside[number] += sign * step
            plant = with_values(self.fitter.plant, fit.effects, _split(beside, fit.effects))
            there = self._scaled(self.fitter.evidence.differences(plant))
            columns.append([sign * (t - h) for t, h in zip(there, here, strict=True)])
        return [np.stack(each) for each in zip(*columns, strict=True)], steps

    def _move(
        self, jacobian: Sequence[Array], here: Sequence[Array], held: Sequence[Ticks]
    ) -> Array:
        """The step, in units of the steps, that the data without a fold ask for."""
        count = len(jacobian[0])
        normal, gradient = np.zeros((count, count)), np.zeros(count)
        for columns, left, out in zip(jacobian, here, held, strict=True):
            inside = columns[:, :, ~out].reshape(count, -1)
            normal += inside @ inside.T
            gradient += inside @ left[:, ~out].ravel()
        normal += np.diag(RIDGE * np.diag(normal) + 1e-12)
        return -np.linalg.solve(normal, gradient)

    def _power(self, left: Sequence[Array]) -> Array:
        found = np.zeros((len(left), BLOCKS))
        for number, (each, block) in enumerate(zip(left, self._blocks, strict=True)):
            power = np.mean(each**2, axis=0)
            found[number] = np.bincount(block, power, BLOCKS) / np.maximum(
                np.bincount(block, minlength=BLOCKS), 1
            )
        return found / self._own[:, None]

    def _are_collinear(
        self, fit: Fit, jacobian: Sequence[Array], here: Sequence[Array], widths: Array
    ) -> bool:
        """Whether the responses of two magnitudes can hardly be told apart: then only their sum
        is known, or their difference, unless both are known very well. What sticks and slips may
        say so of small steps by chance."""
        nominal = np.array(
            [e.nominal(self.fitter.plant)[e.kind.parameters[0]] for e in fit.effects]
        )
        sizes = np.abs(np.array([values[0] for values in fit.values]) - nominal)
        errors = np.array([own[0] for own in _split(widths, fit.effects)])
        if np.all(sizes >= self.rules.surely * errors):
            return False
        return self._alike(fit, jacobian) > self.rules.collinear and (
            self._alike(fit, self._jacobian(fit, here, WIDE)[0]) > self.rules.collinear
        )

    @staticmethod
    def _alike(fit: Fit, jacobian: Sequence[Array]) -> float:
        """The greatest cosine between the responses of two magnitudes."""
        first = np.cumsum([0, *(len(values) for values in fit.values[:-1])])
        gram = sum(
            (flat := columns[first].reshape(len(first), -1)) @ flat.T for columns in jacobian
        )
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        alike = np.abs(gram / np.outer(size, size)) - np.eye(len(first))
        return float(np.max(alike, initial=0.0))

    def _cancels(self, fit: Fit) -> bool:
        """Whether two effects do much more each than together."""
        evidence, plant = self.fitter.evidence, self.fitter.plant
        whole = evidence.residual(fit.plant)

        def change(left_out: set[int]) -> Array:
            kept = [number for number in range(len(fit.effects)) if number not in left_out]
            without = with_values(
                plant, [fit.effects[n] for n in kept], [fit.values[n] for n in kept]
            )
            return evidence.residual(without) - whole

        # What takes the place of a nominal value that is too high undoes nothing; two that are both
        # new may undo each other.
        new = [effect.nominal(plant)[effect.kind.parameters[0]] == 0.0 for effect in fit.effects]
        alone = [change({number}) for number in range(len(fit.effects))]
        for first, one in enumerate(alone):
            for second, other in enumerate(alone[:first]):
                size = min(float(one @ one), float(other @ other))
                if new[first] and new[second] and float(one @ other) < 0.0:
                    together = change({first, second})
                    if float(together @ together) < self.rules.undone**2 * size:
                        return True
        return False


def _ticks(evidence: Evidence) -> list[int]:
    """That are predicted of each recording."""
    return [each.measured.shape[1] for each in evidence.lines]


def _folds(evidence: Evidence) -> list[list[Ticks]]:
    """Which ticks of each recording are held out in turn: whole recordings, or stretches of the
    only one."""
    ticks = _ticks(evidence)
    if len(ticks) > 1:
        return [
            [np.full(count, number == own) for own, count in enumerate(ticks)]
            for number in range(len(ticks))
        ]
    return _stretches(evidence)


def _stretches(evidence: Evidence) -> list[list[Ticks]]:
    """The same for stretches of every recording."""
    ticks = _ticks(evidence)
    pieces = max(FOLDS // len(ticks), 2)
    return [
        [
            np.arange(other) * pieces // other == piece if own == number else np.zeros(other, bool)
            for own, other in enumerate(ticks)
        ]
        for number in range(len(ticks))
        for piece in range(pieces)
    ]


def _split(vector: Array, effects: Sequence[Effect]) -> Values:
    cuts = np.cumsum([len(effect.kind.parameters) for effect in effects])[:-1]
    return tuple(tuple(part.tolist()) for part in np.split(vector, cuts))


def count_independent(evidence: Evidence, fit: Fit) -> float:
    """How many independent pieces what a fit leaves consists of.

    Parameters
    ----------
    evidence
        That it was fitted to.
    fit
        Of any effects.

    Returns
    -------
    float
        The lines that share its power, twice, for real and imaginary parts.
    """
    total = square = 0.0
    for transform in evidence.transforms(evidence.differences(fit.plant)):
        power = np.abs(transform) ** 2
        total, square = total + float(power.sum()), square + float((power**2).sum())
    # The powers of white noise are spread as an exponential, of which this would count half.
    return max(4.0 * total**2 / max(square, 1e-300), math.e)
