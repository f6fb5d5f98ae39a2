"""How well a hypothesis predicts data that are held out of its fit.

The whitened residual of each signal is cut into bands of frequency, and each band into blocks of
time. Where the model is known, every band has a discrepancy of its own scale (a Whittle
likelihood), so that what is left at low frequencies does not hide what happens at high ones.
Blocks, or whole recordings where there are several, are left out in turn; the values are moved to
those of the remaining data by one Gauss-Newton step, and the residual of the blocks left out is
what counts. All of it follows from the normal equations of every block, so that judging a fit costs
one Jacobian.

Nuisance parameters (tolerances) are free beside the effects within their Gaussian priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.diagnosis.blocks import (
    BLOCKS,
    TINY,
    block_products,
    count_independent,
    count_samples,
    excess_by_band,
)
from rigtwin.diagnosis.fit import Fit, Values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import shorten, take_derivatives
from rigtwin.diagnosis.space import BOUND, PRIOR
from rigtwin.numerics.arrays import Array

FOLDS = 5
"""Sets of blocks that are left out in turn where there is one recording; they interleave, so that
each has all directions and speeds."""
RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it."""
SMALLEST = 1e-12
"""Share of the largest response below which another is none."""


@dataclass(frozen=True)
class Scored:
    """A fit and its cross-validation.

    Parameters
    ----------
    fit
        Effects and values.
    levels
        Power of the held-out residual in units of noise and declared error, shape (recordings,
        signals, bands). 1 is no gap; 0 where a recording has no such band.
    inside
        The same of the data of the fit.
    pieces
        Number of independent samples that the residual consists of, of the same shape.
    samples
        Number of all samples, of the same shape.
    excess
        Noise of the motions that drive the model beyond that at the nominal plant, as a share of
        noise and declared error, of the same shape.
    widths
        Standard error of each value. It is the larger of the formal one and the sandwich estimate
        over blocks, which holds for coloured residuals too.
    reach
        Share of each signal in an effect's response, shape (effects, signals).
    together
        For each pair of effects whose responses oppose each other, the size of their joint response
        relative to the smaller of the two; 1 for other pairs; shape (effects, effects).
    accounts
        Amplitude that each effect alone accounts for, the others taken anew, as a share of the
        signals', to first order; shape (effects,).
    rest
        Amplitude of each signal's residual beyond noise and declared error, in the same unit, shape
        (signals,).
    bounded
        Whether a value lies at the end of the range that is searched.
    """

    fit: Fit
    levels: Array = field(repr=False)
    inside: Array = field(repr=False)
    pieces: Array = field(repr=False)
    samples: Array = field(repr=False)
    excess: Array = field(repr=False)
    widths: Values = field(default=(), repr=False)
    reach: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    together: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    accounts: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    rest: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    bounded: bool = False


class Scorer:
    """Scores fits to one body of evidence."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter, self._evidence = fitter, fitter.evidence
        self._known: dict[tuple[object, ...], Scored] = {}
        self._samples = count_samples(self._evidence)
        swings = [
            lines.measured - lines.measured.mean(axis=1, keepdims=True)
            for lines in self._evidence.lines
        ]
        self._signal_power = max(float(np.sum(self._evidence.whiten(swings) ** 2)), TINY)

    def score(self, fit: Fit) -> Scored:
        """Cross-validate a fit.

        Parameters
        ----------
        fit
            Fit to all the evidence.

        Returns
        -------
        Scored
            What it predicts of the data that are left out in turn.
        """
        key = (fit.effects, fit.values, fit.used)
        if key not in self._known:
            self._known[key] = self._score(fit)
        return self._known[key]

    def _score(self, fit: Fit) -> Scored:
        evidence, fitter = self._evidence, self._fitter
        base = fitter.plant if fit.base is None else fit.base
        sizes = [len(effect.kind.parameters) for effect in fit.effects]
        count = sum(sizes)

        def residual(vector: Array) -> Array:
            return evidence.residual(with_values(base, fit.effects, _split(vector, sizes)))

        space = fitter.space.without_replaced(fit.effects)
        here = np.concatenate([np.asarray(v, float) for v in fit.values]) if count else np.zeros(0)
        left = residual(here)
        used = np.array(fit.used) if fit.used else np.zeros(space.columns.shape[1])
        columns = np.zeros((len(left), 0))
        steps = np.zeros(0)
        if count:
            steps = np.concatenate([fitter.starts(effect).steps for effect in fit.effects])
            _, high = fitter.bounds(fit.effects)
            columns = take_derivatives(residual, here, left, steps, high)
            # Steps that change more than is left are secants far from the tangent.
            steps = steps * shorten(columns, float(left @ left))
            columns = take_derivatives(residual, here, left, steps, high)
        # Tolerances that stand at their bound stay there; the others are free about their estimate.
        found = space.estimate_tolerances(left + space.columns @ used)
        free = np.abs(found) < BOUND
        left = left + space.columns @ (used - found)
        free &= np.any(space.columns != 0.0, axis=0)
        stack = np.column_stack([columns, -space.columns[:, free], left])
        products, expected = block_products(evidence, stack)
        prior = np.concatenate([np.zeros(count), np.full(int(free.sum()), PRIOR)])
        samples = self._samples
        levels, inside = _cross_validate(
            products, expected, prior, prior * _pad(found[free], count)
        )
        scored = Scored(
            fit=fit,
            levels=levels,
            inside=inside,
            pieces=np.minimum(count_independent(evidence, left), samples),
            samples=samples,
            excess=excess_by_band(evidence, fit),
        )
        if not count:
            return scored
        places = [sum(sizes[:number]) for number in range(len(sizes))]
        moves = self._moves(fit, here, steps, places)
        return replace(
            scored,
            widths=_split(_standard_errors(products, expected, prior, count) * steps, sizes),
            reach=_reach(places, products),
            together=_together(moves, places, products),
            accounts=self._accounts(moves, places, products, prior),
            rest=self._rest(products, expected),
            bounded=fitter.is_bounded(fit),
        )

    def _moves(self, fit: Fit, here: Array, steps: Array, places: Sequence[int]) -> Array:
        """How many steps each magnitude is off nominal, shape (effects,)."""
        nominal = [
            effect.nominal(self._fitter.plant)[effect.kind.parameters[0]] for effect in fit.effects
        ]
        return (here[places] - np.array(nominal)) / steps[places]

    def _accounts(
        self, moves: Array, places: Sequence[int], products: Array, prior: Array
    ) -> Array:
        """Share of the signals' amplitude that would be left without each effect."""
        inverse = np.linalg.inv(_normal_matrix(products, prior))
        power = moves**2 / np.maximum(np.diag(inverse)[places], TINY)
        return np.asarray(np.sqrt(power / self._signal_power))

    def _rest(self, products: Array, expected: Array) -> Array:
        """Amplitude of each signal beyond noise and declared error, as a share of all signals'."""
        beyond = products[..., -1, -1].sum(axis=(0, 2, 3)) - expected.sum(axis=(0, 2, 3))
        return np.asarray(np.sqrt(np.maximum(beyond, 0.0) / self._signal_power))


def _together(moves: Array, places: Sequence[int], products: Array) -> Array:
    """How far pairs of effects undo each other, to first order."""
    gram = products.sum(axis=(0, 1, 2, 3))[np.ix_(places, places)] * np.outer(moves, moves)
    size = np.diag(gram)
    both = np.maximum(size[:, None] + size[None, :] + 2.0 * gram, 0.0)
    least = np.minimum(size[:, None], size[None, :])
    relative = np.sqrt(both / np.maximum(least, SMALLEST * float(np.max(size, initial=TINY))))
    relative[gram >= 0.0] = 1.0
    return np.minimum(relative, 1.0)


def _reach(places: Sequence[int], products: Array) -> Array:
    """Share of each signal in the response to each effect's magnitude, to first order."""
    power = np.stack([products[..., place, place].sum(axis=(0, 2, 3)) for place in places])
    return np.asarray(power / np.maximum(power.sum(axis=1, keepdims=True), TINY))


def _pad(values: Array, count: int) -> Array:
    return np.concatenate([np.zeros(count), values])


def _split(vector: Array, sizes: Sequence[int]) -> Values:
    cuts = np.cumsum(sizes)[:-1]
    return tuple(tuple(part.tolist()) for part in np.split(vector, cuts)) if len(sizes) else ()


def _folds(recordings: int) -> list[NDArray[np.bool_]]:
    """Which blocks are left out in turn, shape (recordings, blocks) each."""
    if recordings > 1:
        return [
            np.repeat(np.arange(recordings)[:, None] == number, BLOCKS, axis=1)
            for number in range(recordings)
        ]
    return [np.arange(BLOCKS)[None, :] % FOLDS == fold for fold in range(FOLDS)]


def _cross_validate(
    products: Array, expected: Array, prior: Array, pull: Array
) -> tuple[Array, Array]:
    """Power of the residual left out and of the whole fit, in units of what is expected.

    pull: gradient of the prior at the values of the fit.
    """
    count = products.shape[-1] - 1
    normal, gradient = products[..., :count, :count], products[..., :count, count]
    power = products[..., count, count]
    out = power.copy()
    if count:
        blocks, slopes = normal.sum(axis=(1, 2)), gradient.sum(axis=(1, 2))
        whole, right = blocks.sum(axis=(0, 1)), slopes.sum(axis=(0, 1))
        ridge = np.diag(prior + RIDGE * np.diag(whole) + 1e-12)
        # What all data still ask for is no matter of the fold: where the residual is not linear, as
        # at a stick, a fit is no stationary point of its linearisation.
        still = -np.linalg.solve(whole + ridge, right + pull)
        for held in _folds(len(products)):
            rest = whole - blocks[held].sum(axis=0) + ridge
            move = -np.linalg.solve(rest, right - slopes[held].sum(axis=0) + pull) - still
            changed = power + 2.0 * gradient @ move + (normal @ move) @ move
            places = np.broadcast_to(held[:, None, None, :], power.shape)
            out[places] = changed[places]
    total = expected.sum(axis=3)
    inverse = np.where(total > 0.0, 1.0 / np.maximum(total, TINY), 0.0)
    return np.maximum(out.sum(axis=3), 0.0) * inverse, power.sum(axis=3) * inverse


def _normal_matrix(products: Array, prior: Array) -> Array:
    """Normal matrix of all data with the prior of the nuisances."""
    columns = products.shape[-1] - 1
    normal = products[..., :columns, :columns].sum(axis=(0, 1, 2, 3))
    return np.asarray(normal + np.diag(prior + RIDGE * np.diag(normal) + 1e-12))


def _standard_errors(products: Array, expected: Array, prior: Array, count: int) -> Array:
    """Standard errors of the effects' parameters, in steps.

    The formal ones are widened by what the residual exceeds noise and declared error; the sandwich
    estimate takes the scatter of the gradient over blocks instead [White 1980].
    """
    columns = products.shape[-1] - 1
    inverse = np.linalg.inv(_normal_matrix(products, prior))
    scores = products[..., :columns, columns].sum(axis=(1, 2)).reshape(-1, columns)
    blocks = len(scores)
    spread = scores.T @ scores * blocks / max(blocks - columns, 1)
    sandwich = inverse @ spread @ inverse
    excess = max(float(products[..., columns, columns].sum() / max(expected.sum(), TINY)), 1.0)
    variance = np.maximum(np.diag(sandwich), np.diag(excess * inverse))[:count]
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
