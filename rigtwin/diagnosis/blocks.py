"""Whitened residuals cut into bands of frequency and blocks of time.

A whitened vector has the spectra of all signals of all recordings one after another. Each band of a
spectrum is moved down to 0 Hz and transformed back, so that its power at every moment is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit
from rigtwin.numerics.arrays import Array

BLOCKS = 20
"""Blocks of each recording."""
FEWEST = 3
"""Independent samples that a residual has in each block at least, however narrow its band."""
NARROWEST = 2 * BLOCKS
"""Lines of the lowest band; each band is twice as wide as the one before."""
TINY = 1e-300


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

    Parameters
    ----------
    evidence
        The evidence.

    Returns
    -------
    array
        Shape (recordings, signals, bands).
    """
    even = evidence.machine.prior.even
    return align(
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
    return np.maximum(align(counts), float(FEWEST * BLOCKS))


def align(arrays: Sequence[Array]) -> Array:
    """Stack arrays of shape (signals, bands, ...), zeros where a recording has fewer bands."""
    most = max(each.shape[1] for each in arrays)
    found = np.zeros((len(arrays), arrays[0].shape[0], most, *arrays[0].shape[2:]))
    for whole, each in zip(found, arrays, strict=True):
        whole[:, : each.shape[1]] = each
    return found


def excess_by_band(evidence: Evidence, fit: Fit) -> Array:
    """Average over each band the noise at a fit beyond that at the nominal plant.

    Parameters
    ----------
    evidence
        The evidence.
    fit
        Fit whose plant is meant.

    Returns
    -------
    array
        Variance in units of noise and declared error, shape (recordings, signals, bands).
    """
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
    return align(found)


def block_products(evidence: Evidence, stack: Array) -> tuple[Array, Array]:
    """Multiply whitened columns with each other in every block.

    Parameters
    ----------
    evidence
        The evidence.
    stack
        Whitened columns, shape (size, columns).

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
    return align(products), align(expected)


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
