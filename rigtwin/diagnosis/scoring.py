"""Cross-validation of hypotheses: how well a fit predicts data that are held out of it.

The whitened residual of each signal is cut into bands of frequency, and each band into blocks of
time. Where the model is known, every band has a discrepancy of its own scale (a Whittle
likelihood), so that a large residual at low frequencies does not mask one at high frequencies.

Blocks, or whole recordings where there are several, are held out in turn. Let r_b be the residual
of block b, J_b its jacobian in the fitted parameters and the free tolerances, and P their prior
precision. Without the held-out blocks H, one Gauss-Newton step moves the parameters by

    m_H = -(sum(J_b'J_b) + P)^-1 (sum(J_b'r_b) + p),        sums over b not in H,

with p the gradient of the prior. The held-out power of a block in H is |r_b + J_b m_H|^2. All of it
follows from the products J'J, J'r and r'r of every block, so that judging a fit costs one jacobian.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rigtwin.diagnosis.blocks import (
    TINY,
    block_products,
    count_independent,
    count_samples,
    excess_by_band,
)
from rigtwin.diagnosis.fit import Fit, Values, split_values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import shorten, take_derivatives
from rigtwin.diagnosis.left_out_blocks import cross_validate, normal_matrix, standard_errors
from rigtwin.diagnosis.space import BOUND, PRIOR
from rigtwin.numerics.arrays import Array

SMALLEST_RESPONSE = 1e-12
"""Share of the largest response below which an effect has no response."""


@dataclass(frozen=True)
class Scored:
    """A fit and its cross-validation.

    Attributes
    ----------
    fit
        Fitted effects and values.
    levels
        Power of the held-out residual in units of noise and declared error, shape (recordings,
        signals, bands). 1 is no gap; 0 where a recording has no such band.
    inside
        Power of the residual on the data of the fit, in the same units and shape.
    pieces
        Number of independent samples of the residual, of the same shape.
    samples
        Number of all samples, of the same shape.
    excess, relief
        Noise of the motions that drive the model, above and below that at the nominal
        plant, as shares of noise and declared error, of the same shape. `relief` is 0 or less.
    widths
        Standard error of each value: the larger of the formal one and the sandwich estimate over
        blocks. The latter is valid for coloured residuals.
    reach
        Share of each signal in an effect's response, shape (effects, signals).
    together
        For each pair of effects whose responses oppose each other, the size of their joint response
        relative to the smaller of the two; 1 for other pairs; shape (effects, effects).
    accounts
        Amplitude that each effect accounts for when all others are refitted, as a share of the
        signals' amplitude, to first order; shape (effects,).
    rest
        Amplitude of each signal's residual beyond noise and declared error, as a share of the
        signals' amplitude, shape (signals,).
    bounded
        Whether a value is held by a bound of its range.
    """

    fit: Fit
    levels: Array = field(repr=False)
    inside: Array = field(repr=False)
    pieces: Array = field(repr=False)
    samples: Array = field(repr=False)
    excess: Array = field(repr=False)
    relief: Array = field(repr=False)
    widths: Values = field(default=(), repr=False)
    reach: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    together: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    accounts: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    rest: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    bounded: bool = False


class Scorer:
    """Scores fits to one body of evidence.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    """

    def __init__(self, fitter: Fitter) -> None:
        self._fitter, self._evidence = fitter, fitter.evidence
        self._cache: dict[tuple[object, ...], Scored] = {}
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
            The fit with the power of its residual on held-out data.
        """
        # Equal values with other tolerances leave another residual.
        key = (fit.effects, fit.values, fit.used)
        if key not in self._cache:
            self._cache[key] = self._score(fit)
        return self._cache[key]

    def _score(self, fit: Fit) -> Scored:
        evidence, fitter = self._evidence, self._fitter
        base = fitter.plant if fit.base is None else fit.base

        def residual_at(vector: Array) -> Array:
            return evidence.residual(
                with_values(base, fit.effects, split_values(fit.effects, vector))
            )

        space = fitter.space.without_replaced(fit.effects)
        values = np.array([value for values in fit.values for value in values], float)
        count = len(values)
        residual = residual_at(values)
        used = np.array(fit.used) if fit.used else np.zeros(space.columns.shape[1])
        columns, steps = self._derive(fit, residual_at, values, residual)
        # Tolerances at their bound are fixed there; the others are free about their estimate.
        estimate = space.estimate_tolerances(residual + space.columns @ used)
        free = np.abs(estimate) < BOUND
        residual = residual + space.columns @ (used - estimate)
        # Replaced tolerances have columns of zeros (`Space`) and are no parameters of this fit.
        free &= np.any(space.columns != 0.0, axis=0)
        # One stack of J (effects, then tolerances) and r gives all products at once.
        # `take_derivatives` gives changes of the residual, measured minus predicted, and
        # `Space.columns` changes of the prediction: hence the minus sign.
        stack = np.column_stack([columns, -space.columns[:, free], residual])
        products, expected = block_products(evidence, stack)
        prior = np.concatenate([np.zeros(count), np.full(int(free.sum()), PRIOR)])
        samples = self._samples
        # All gradients are halves: J'r and PRIOR t are those of |r|²/2 and PRIOR |t|²/2.
        levels, inside = cross_validate(
            products, expected, prior, prior * _pad(estimate[free], count)
        )
        excess, relief = excess_by_band(evidence, fit)
        scored = Scored(
            fit=fit,
            levels=levels,
            inside=inside,
            pieces=np.minimum(count_independent(evidence, residual), samples),
            samples=samples,
            excess=excess,
            relief=relief,
        )
        if not count:
            return scored
        moves = self._moves(fit, values, steps)
        return replace(
            scored,
            widths=split_values(
                fit.effects, standard_errors(products, expected, prior, count) * steps
            ),
            reach=_reach(moves, products),
            together=_together(moves, products),
            accounts=self._accounts(moves, products, prior),
            rest=self._rest(products, expected),
            bounded=fitter.is_bounded(fit),
        )

    def _derive(
        self, fit: Fit, residual_at: Callable[[Array], Array], values: Array, residual: Array
    ) -> tuple[Array, Array]:
        """Return the change of the residual by a step of each value, and these steps."""
        if not fit.effects:
            return np.zeros((len(residual), 0)), np.zeros(0)
        steps = np.concatenate([self._fitter.starts(effect).steps for effect in fit.effects])
        _, high = self._fitter.bounds(fit.effects)
        columns = take_derivatives(residual_at, values, residual, steps, high)
        # A step that changes more than the residual itself gives a secant far from the tangent.
        steps = steps * shorten(columns, float(residual @ residual))
        return take_derivatives(residual_at, values, residual, steps, high), steps

    def _moves(self, fit: Fit, values: Array, steps: Array) -> Array:
        """Return the difference of each effect's magnitudes from nominal, in steps.

        The shape is (parameters, effects); parameters that are no magnitude of the effect are 0.
        """
        moves, place = np.zeros((len(values), len(fit.effects))), 0
        for number, effect in enumerate(fit.effects):
            nominal = effect.nominal(self._fitter.plant)
            for offset, name in enumerate(effect.kind.parameters):
                if offset < effect.kind.magnitudes:
                    change = values[place + offset] - nominal[name]
                    moves[place + offset, number] = change / steps[place + offset]
            place += len(effect.kind.parameters)
        return moves

    def _accounts(self, moves: Array, products: Array, prior: Array) -> Array:
        """Return the share of the signals' amplitude that each effect accounts for.

        To first order, moving parameters back by m while all others are refitted raises the
        chi-square by m' C^-1 m, with C the block of these parameters in N^-1 and N the normal
        matrix.
        """
        inverse = np.linalg.inv(normal_matrix(products, prior))
        power = np.zeros(moves.shape[1])
        for number, column in enumerate(moves.T):
            places = np.nonzero(column)[0]
            if len(places):
                block = inverse[np.ix_(places, places)]
                power[number] = column[places] @ np.linalg.solve(block, column[places])
        return np.asarray(np.sqrt(np.maximum(power, 0.0) / self._signal_power))

    def _rest(self, products: Array, expected: Array) -> Array:
        """Return each signal's residual beyond noise and declared error, as a share of all
        signals' amplitude."""
        # The last row and column of the products is the residual's own power.
        beyond = products[..., -1, -1].sum(axis=(0, 2, 3)) - expected.sum(axis=(0, 2, 3))
        return np.asarray(np.sqrt(np.maximum(beyond, 0.0) / self._signal_power))


def _together(moves: Array, products: Array) -> Array:
    """Return the joint response of each pair of effects relative to the smaller single response.

    With responses a and b, |a + b| / min(|a|, |b|). Pairs that do not oppose each other have 1.
    """
    count = len(moves)
    gram = moves.T @ products.sum(axis=(0, 1, 2, 3))[:count, :count] @ moves
    size = np.diag(gram)
    both = np.maximum(size[:, None] + size[None, :] + 2.0 * gram, 0.0)
    least = np.minimum(size[:, None], size[None, :])
    # A pair in which one effect has no response must not appear to cancel.
    negligible = SMALLEST_RESPONSE * float(np.max(size, initial=TINY))
    relative = np.sqrt(both / np.maximum(least, negligible))
    relative[gram >= 0.0] = 1.0
    return np.minimum(relative, 1.0)


def _reach(moves: Array, products: Array) -> Array:
    """Return the share of each signal in the response to each effect, shape (effects, signals)."""
    count = len(moves)
    signals = products.sum(axis=(0, 2, 3))[:, :count, :count]
    # The diagonal of M' G_s M for each signal s, with the products G_s of the jacobian: the power
    # of an effect's response in that signal alone.
    power = np.einsum("pe,spq,qe->es", moves, signals, moves)
    return np.asarray(power / np.maximum(power.sum(axis=1, keepdims=True), TINY))


def _pad(values: Array, count: int) -> Array:
    """Put zeros before values: the effects' parameters have no prior."""
    return np.concatenate([np.zeros(count), values])
