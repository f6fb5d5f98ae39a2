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

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, Values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import take_derivatives
from rigtwin.diagnosis.space import BEYOND, PRIOR
from rigtwin.numerics.arrays import Array

BLOCKS = 20
"""Blocks of each recording."""
FEWEST = 3
"""Independent samples that a residual has in each block at least, however narrow its band."""
NARROWEST = 2 * BLOCKS
"""Lines of the lowest band; each band is twice as wide as the one before."""
FOLDS = 5
"""Sets of blocks that are left out in turn where there is one recording; they interleave, so that
each has all directions and speeds."""
RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it."""
TINY = 1e-300
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
    correlation
        Correlation matrix of all parameters of the effects.
    reach
        Share of each signal in an effect's response, shape (effects, signals).
    together
        For each pair of effects whose responses oppose each other, the size of their joint response
        relative to the smaller of the two; 1 for other pairs; shape (effects, effects).
    accounts
        Amplitude that each effect alone accounts for, the others taken anew, as a share of the
        signals', to first order; shape (effects,).
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
    correlation: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    reach: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    together: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    accounts: Array = field(default_factory=lambda: np.zeros(0), repr=False)
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

        space = fitter.space.beside(fit.effects)
        here = np.concatenate([np.asarray(v, float) for v in fit.values]) if count else np.zeros(0)
        left = residual(here)
        used = np.array(fit.used) if fit.used else np.zeros(space.columns.shape[1])
        columns = np.zeros((len(left), 0))
        steps = np.zeros(0)
        if count:
            steps = np.concatenate([fitter.starts(effect).steps for effect in fit.effects])
            _, high = fitter.bounds(fit.effects)
            columns = take_derivatives(residual, here, left, steps, high)
        # Tolerances that stand at their bound stay there; the others are free about their estimate.
        found = space.estimate_tolerances(left + space.columns @ used)
        free = np.abs(found) < BEYOND
        left = left + space.columns @ (used - found)
        free &= np.any(space.columns != 0.0, axis=0)
        stack = np.column_stack([columns, -space.columns[:, free], left])
        products, expected = _block_products(evidence, stack)
        prior = np.concatenate([np.zeros(count), np.full(int(free.sum()), PRIOR)])
        samples = self._samples
        levels, inside = _cross_validate(
            products, expected, prior, prior * _pad(found[free], count)
        )
        widths, correlation = _covariance(products, expected, prior, count)
        return Scored(
            fit=fit,
            levels=levels,
            inside=inside,
            pieces=np.minimum(count_independent(evidence, left), samples),
            samples=samples,
            excess=_excess_by_band(evidence, fit),
            widths=_split(widths * steps, sizes),
            correlation=correlation,
            reach=self._reach(fit, sizes, products),
            together=self._together(fit, here, steps, sizes, products),
            accounts=self._accounts(fit, here, steps, sizes, products, prior),
            bounded=bool(fit.effects) and fitter.is_bounded(fit),
        )

    def _together(
        self, fit: Fit, here: Array, steps: Array, sizes: Sequence[int], products: Array
    ) -> Array:
        """How far pairs of effects undo each other, to first order."""
        count = len(fit.effects)
        places = np.cumsum([0, *sizes])[:count]
        gram = products.sum(axis=(0, 1, 2, 3))[np.ix_(places, places)]
        moves = np.array(
            [
                (here[place] - effect.nominal(self._fitter.plant)[effect.kind.parameters[0]])
                / steps[place]
                for effect, place in zip(fit.effects, places, strict=True)
            ]
        )
        gram = gram * np.outer(moves, moves)
        size = np.diag(gram)
        both = np.maximum(size[:, None] + size[None, :] + 2.0 * gram, 0.0)
        least = np.minimum(size[:, None], size[None, :])
        relative = np.sqrt(both / np.maximum(least, SMALLEST * float(np.max(size, initial=TINY))))
        relative[gram >= 0.0] = 1.0
        return np.minimum(relative, 1.0)

    def _accounts(
        self,
        fit: Fit,
        here: Array,
        steps: Array,
        sizes: Sequence[int],
        products: Array,
        prior: Array,
    ) -> Array:
        """Share of the signals' amplitude that would be left without each effect."""
        if not fit.effects:
            return np.zeros(0)
        inverse = np.linalg.inv(_normal_matrix(products, prior))
        places = np.cumsum([0, *sizes])[: len(fit.effects)]
        found = []
        for effect, place in zip(fit.effects, places, strict=True):
            nominal = effect.nominal(self._fitter.plant)[effect.kind.parameters[0]]
            move = (here[place] - nominal) / steps[place]
            found.append(move**2 / max(float(inverse[place, place]), TINY))
        return np.sqrt(np.array(found) / self._signal_power)

    def _reach(self, fit: Fit, sizes: Sequence[int], products: Array) -> Array:
        """Share of each signal in the response to each effect's magnitude, to first order."""
        rows = len(self._evidence.names)
        shares = np.zeros((len(fit.effects), rows))
        for number in range(len(fit.effects)):
            place = int(np.sum(sizes[:number]))
            power = np.sum(products[..., place, place], axis=(0, 2, 3))
            shares[number] = power / max(float(np.sum(power)), TINY)
        return shares


def _pad(values: Array, count: int) -> Array:
    return np.concatenate([np.zeros(count), values])


def _split(vector: Array, sizes: Sequence[int]) -> Values:
    cuts = np.cumsum(sizes)[:-1]
    return tuple(tuple(part.tolist()) for part in np.split(vector, cuts)) if len(sizes) else ()


def split_transforms(evidence: Evidence, vector: Array) -> list[NDArray[np.complex128]]:
    """Undo `Evidence.whiten`.

    Parameters
    ----------
    evidence
        The evidence that whitened it.
    vector
        Whitened signals as one vector, shape (size,).

    Returns
    -------
    list of arrays
        Weighted spectra, shape (signals, lines) for each recording.
    """
    found, place = [], 0
    for lines in evidence.lines:
        size = lines.weight.size
        real, imaginary = vector[place : place + size], vector[place + size : place + 2 * size]
        found.append((real + 1j * imaginary).reshape(lines.weight.shape))
        place += 2 * size
    return found


def find_bands(lines: int, even: float) -> list[slice]:
    """Bands of frequency, each twice as wide as the one below it.

    Parameters
    ----------
    lines
        Lines of a spectrum.
    even
        Share of the model error that is spread evenly: see `ModelPrior`. Where all of it is, one
        scale holds for all frequencies.

    Returns
    -------
    list of slice
        Lines of each band; the last one has what remains.
    """
    if even == 1.0:
        return [slice(0, lines)]
    edges, width = [0], NARROWEST
    while edges[-1] + 3 * width <= lines:
        edges.append(edges[-1] + width)
        width *= 2
    return [slice(low, high) for low, high in zip(edges, [*edges[1:], lines], strict=True)]


def count_samples(evidence: Evidence) -> Array:
    """Count the real numbers that each band of each signal consists of.

    Returns
    -------
    array
        Shape (recordings, signals, bands).
    """
    even = evidence.machine.prior.even
    return _align(
        [
            np.stack(
                [
                    2.0 * np.count_nonzero(lines.weight[:, band], axis=1)
                    for band in find_bands(lines.weight.shape[1], even)
                ],
                axis=1,
            )
            for lines in evidence.lines
        ]
    )


def count_independent(evidence: Evidence, residual: Array) -> Array:
    """Count the independent samples that a residual consists of.

    A band of N lines of equal expected power has 2 N, for real and imaginary parts; a residual that
    stands in few lines has few.

    Parameters
    ----------
    evidence
        The evidence.
    residual
        Whitened, shape (size,).

    Returns
    -------
    array
        Shape (recordings, signals, bands).
    """
    counts = []
    for spectrum in split_transforms(evidence, residual):
        power = np.abs(spectrum) ** 2
        own = []
        for band in find_bands(power.shape[1], evidence.machine.prior.even):
            total, squared = power[:, band].sum(axis=1), (power[:, band] ** 2).sum(axis=1)
            # The powers of white noise are exponentially distributed, of which the participation
            # ratio counts half: 4 instead of 2.
            most = 2.0 * np.count_nonzero(power[:, band], axis=1)
            own.append(np.minimum(4.0 * total**2 / np.maximum(squared, TINY), most))
        counts.append(np.stack(own, axis=1))
    return np.maximum(_align(counts), float(FEWEST * BLOCKS))


def _align(arrays: Sequence[Array]) -> Array:
    """Stack arrays of shape (signals, bands, ...), zeros where a recording has fewer bands."""
    most = max(each.shape[1] for each in arrays)
    found = np.zeros((len(arrays), arrays[0].shape[0], most, *arrays[0].shape[2:]))
    for whole, each in zip(found, arrays, strict=True):
        whole[:, : each.shape[1]] = each
    return found


def _excess_by_band(evidence: Evidence, fit: Fit) -> Array:
    """Noise at a fit beyond that at the nominal plant, as a share of noise and declared error."""
    even, found = evidence.machine.prior.even, []
    for lines, excess in zip(evidence.lines, evidence.excess_noise(fit.plant), strict=True):
        bands = find_bands(lines.weight.shape[1], even)
        if excess is None:
            found.append(np.zeros((lines.weight.shape[0], len(bands))))
            continue
        counted = lines.weight > 0.0
        own = [
            np.sum(excess[:, band], axis=1) / np.maximum(np.sum(counted[:, band], axis=1), 1)
            for band in bands
        ]
        found.append(np.stack(own, axis=1))
    return _align(found)


def _block_products(evidence: Evidence, stack: Array) -> tuple[Array, Array]:
    """Inner products of whitened columns in every block.

    Returns
    -------
    tuple
        Products, shape (recordings, signals, bands, blocks, columns, columns); and the power that
        noise and declared error have there, shape (recordings, signals, bands, blocks).
    """
    spectra = [split_transforms(evidence, column) for column in stack.T]
    products, expected = [], []
    for number, lines in enumerate(evidence.lines):
        columns = np.stack([each[number] for each in spectra])
        noise = 2.0 * (lines.weight > 0.0)
        own, powers = [], []
        for band in find_bands(columns.shape[2], evidence.machine.prior.even):
            blocks = _cut(columns[:, :, band], lines.measured.shape[1] / lines.length)
            own.append(blocks @ blocks.transpose(0, 1, 3, 2))
            edges = np.linspace(0, lines.fade.shape[1], BLOCKS + 1).astype(int)
            share = np.add.reduceat(lines.fade**2, edges[:-1], axis=1)
            share /= np.maximum(share.sum(axis=1, keepdims=True), TINY)
            powers.append(share * noise[:, band].sum(axis=1)[:, None])
        products.append(np.stack(own, axis=1))
        expected.append(np.stack(powers, axis=1))
    return _align(products), _align(expected)


def _cut(columns: NDArray[np.complex128], part: float) -> Array:
    """Spectra of one band as signals in blocks of time, shape (signals, blocks, columns, samples).

    The band is moved down to start at 0 Hz, which leaves powers and products as they are.
    part: share of the transform's length that the recording fills.
    """
    columns = columns.copy()
    # Twice as many samples as lines, so that the last line is no Nyquist line, which would lose its
    # imaginary part; neither must the first be the mean. By Parseval sum |X|^2 = (n / 2) sum x^2.
    samples = 2 * (columns.shape[2] + 1)
    padded = np.concatenate([np.zeros((*columns.shape[:2], 1)), columns], axis=2)
    signals = np.fft.irfft(padded, samples, axis=2) * math.sqrt(samples / 2.0)
    edges = np.linspace(0, min(math.ceil(samples * part), samples), BLOCKS + 1).astype(int)
    longest = int(np.max(np.diff(edges)))
    found = np.zeros((signals.shape[1], BLOCKS, signals.shape[0], longest))
    for block, (low, high) in enumerate(pairwise(edges)):
        found[:, block, :, : high - low] = signals[:, :, low:high].transpose(1, 0, 2)
    return found


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


def _covariance(products: Array, expected: Array, prior: Array, count: int) -> tuple[Array, Array]:
    """Standard errors of the effects' parameters, in steps, and their correlation."""
    if not count:
        return np.zeros(0), np.zeros((0, 0))
    columns = products.shape[-1] - 1
    inverse = np.linalg.inv(_normal_matrix(products, prior))
    scores = products[..., :columns, columns].sum(axis=(1, 2)).reshape(-1, columns)
    blocks = len(scores)
    spread = scores.T @ scores * blocks / max(blocks - columns, 1)
    sandwich = inverse @ spread @ inverse
    excess = max(float(products[..., columns, columns].sum() / max(expected.sum(), TINY)), 1.0)
    formal = excess * inverse
    variance = np.maximum(np.diag(sandwich), np.diag(formal))[:count]
    size = np.sqrt(np.maximum(np.diag(inverse)[:count], TINY))
    return np.sqrt(np.maximum(variance, 0.0)), inverse[:count, :count] / np.outer(size, size)
