"""Whitened residuals cut into bands of frequency and blocks of time.

A whitened vector holds the spectra of all signals of all recordings one after another. Each band of
a spectrum is shifted down to 0 Hz and transformed back to the time domain. This complex
demodulation gives the power of the band at every moment, and by Parseval's theorem it preserves
all sums of products over the band.
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
"""Number of blocks of each recording."""
FEWEST = 3
"""Minimum number of independent samples of a residual in each block, however narrow its band."""
NARROWEST = 2 * BLOCKS
"""Number of lines of the lowest band. Each band is twice as wide as the one below it."""
TINY = 1e-300
"""Smallest divisor."""


def split_transforms(evidence: Evidence, vector: Array) -> list[NDArray[np.complex128]]:
    """Split a whitened vector into spectra: the inverse of `Evidence.whiten`.

    Parameters
    ----------
    evidence
        Evidence that whitened the vector.
    vector
        Whitened signals as one vector, shape (size,).

    Returns
    -------
    list of arrays
        Weighted spectra, shape (signals, lines) for each recording.
    """
    spectra, place = [], 0
    for lines in evidence.lines:
        # `Evidence.whiten` writes the real parts of all lines of a recording before the imaginary
        # ones.
        size = lines.weight.size
        real, imaginary = vector[place : place + size], vector[place + size : place + 2 * size]
        spectra.append((real + 1j * imaginary).reshape(lines.weight.shape))
        place += 2 * size
    return spectra


def find_bands(lines: int, even: float) -> list[slice]:
    """Divide a spectrum into bands of frequency, each twice as wide as the one below it.

    Parameters
    ----------
    lines
        Number of lines of a spectrum.
    even
        Share of the declared model error that is spread evenly, see `ModelPrior`. At 1 there is a
        single band, as one scale applies to all frequencies.

    Returns
    -------
    list of slice
        Lines of each band. The last band has all remaining lines.
    """
    if even == 1.0:
        return [slice(0, lines)]
    # The width doubles from band to band, as on a logarithmic axis of frequency.
    edges, width = [0], NARROWEST
    # A band ends only where the next one, twice as wide, is complete. The last band takes the rest,
    # so that no band at the top is nearly empty.
    while edges[-1] + 3 * width <= lines:
        edges.append(edges[-1] + width)
        width *= 2
    return [slice(low, high) for low, high in zip(edges, [*edges[1:], lines], strict=True)]


def count_samples(evidence: Evidence) -> Array:
    """Count the samples of each band of each signal: two real numbers for each line.

    Parameters
    ----------
    evidence
        Evidence with its spectra.

    Returns
    -------
    array
        Number of samples, shape (recordings, signals, bands).
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
    """Estimate the number of independent samples of a residual.

    With the power P_k in line k, it is 4 (sum P_k)^2 / sum P_k^2, the participation ratio. White
    noise in N lines has 2 N independent samples, for the real and imaginary parts. A residual that
    is concentrated in few lines has few.

    Parameters
    ----------
    evidence
        Evidence with its spectra.
    residual
        Whitened residual, shape (size,).

    Returns
    -------
    array
        Number of independent samples, shape (recordings, signals, bands).
    """
    counts = []
    for spectrum in split_transforms(evidence, residual):
        power = np.abs(spectrum) ** 2
        by_band = []
        for band in find_bands(power.shape[1], evidence.machine.prior.even):
            total, squared = power[:, band].sum(axis=1), (power[:, band] ** 2).sum(axis=1)
            # The powers of white noise are exponentially distributed, with E[P^2] = 2 E[P]^2. The
            # plain ratio is therefore N / 2, and the factor for 2 N samples is 4.
            most = 2.0 * np.count_nonzero(power[:, band], axis=1)
            by_band.append(np.minimum(4.0 * total**2 / np.maximum(squared, TINY), most))
        counts.append(np.stack(by_band, axis=1))
    # Bands that a recording lacks get this floor too. `Scorer` limits the count to the number of
    # samples, which is 0 there.
    return np.maximum(align(counts), float(FEWEST * BLOCKS))


def align(arrays: Sequence[Array]) -> Array:
    """Stack arrays of recordings with different numbers of bands.

    Parameters
    ----------
    arrays
        Arrays of shape (signals, bands, ...), one for each recording.

    Returns
    -------
    array
        Shape (recordings, signals, bands, ...), with zeros for bands that a recording lacks.
    """
    most = max(part.shape[1] for part in arrays)
    stacked = np.zeros((len(arrays), arrays[0].shape[0], most, *arrays[0].shape[2:]))
    for place, part in zip(stacked, arrays, strict=True):
        place[:, : part.shape[1]] = part
    return stacked


def excess_by_band(evidence: Evidence, fit: Fit) -> tuple[Array, Array]:
    """Return how far the propagated noise at a fit is above and below that at the nominal plant.

    Both are averaged over each band.

    Parameters
    ----------
    evidence
        Evidence with its spectra.
    fit
        Fit whose plant propagates the noise.

    Returns
    -------
    above, below : Array
        Variance in units of noise and declared error, 0 or more and 0 or less, shape (recordings,
        signals, bands) each.
    """
    even = evidence.machine.prior.even
    above: list[Array] = []
    below: list[Array] = []
    for lines, excess in zip(evidence.lines, evidence.excess_noise(fit.plant), strict=True):
        bands = find_bands(lines.weight.shape[1], even)
        if excess is None:
            above.append(np.zeros((lines.weight.shape[0], len(bands))))
            below.append(above[-1])
            continue
        # Excluded lines (the mains) have no weight, so their excess is 0 and would dilute a mean.
        counted = lines.weight > 0.0
        for averages, part in (
            (above, np.maximum(excess, 0.0)),
            (below, np.minimum(excess, 0.0)),
        ):
            by_band = [
                np.sum(part[:, band], axis=1) / np.maximum(np.sum(counted[:, band], axis=1), 1)
                for band in bands
            ]
            averages.append(np.stack(by_band, axis=1))
    return align(above), align(below)


def block_products(evidence: Evidence, stack: Array) -> tuple[Array, Array]:
    """Return the products of whitened columns with each other in every block.

    Parameters
    ----------
    evidence
        Evidence with its spectra.
    stack
        Whitened columns, shape (size, columns).

    Returns
    -------
    tuple
        Products, shape (recordings, signals, bands, blocks, columns, columns), and the expected
        power of noise and declared error, shape (recordings, signals, bands, blocks).
    """
    spectra = [split_transforms(evidence, column) for column in stack.T]
    products, expected = [], []
    for number, lines in enumerate(evidence.lines):
        columns = np.stack([spectrum[number] for spectrum in spectra])
        # By the weights' definition real and imaginary part of a counted line have unit variance
        # each.
        noise = 2.0 * (lines.weight > 0.0)
        by_band, powers = [], []
        for band in find_bands(columns.shape[2], evidence.machine.prior.even):
            blocks = _cut(columns[:, :, band], lines.measured.shape[1] / lines.length)
            by_band.append(blocks @ blocks.transpose(0, 1, 3, 2))
            # Noise is stationary, so that a block has the share of its power that its part of the
            # squared window has.
            edges = np.linspace(0, lines.fade.shape[1], BLOCKS + 1).astype(int)
            share = np.add.reduceat(lines.fade**2, edges[:-1], axis=1)
            share /= np.maximum(share.sum(axis=1, keepdims=True), TINY)
            powers.append(share * noise[:, band].sum(axis=1)[:, None])
        products.append(np.stack(by_band, axis=1))
        expected.append(np.stack(powers, axis=1))
    return align(products), align(expected)


def _cut(columns: NDArray[np.complex128], part: float) -> Array:
    """Transform one band to the time domain, and cut it into blocks.

    The band is shifted down to 0 Hz, which preserves powers and products. `part` is the share of
    the transform's length that the recording fills; the rest is padding. The result has the shape
    (signals, blocks, columns, samples), with zeros after the shorter blocks.
    """
    columns = columns.copy()
    # The inverse transform ignores the imaginary parts of its first and last line, the mean and the
    # Nyquist line. One zero is put before the band, and there are more than twice as many samples
    # as lines, so that no line of the band is either. By Parseval sum |X|^2 = (n / 2) sum x^2.
    samples = 2 * (columns.shape[2] + 1)
    padded = np.concatenate([np.zeros((*columns.shape[:2], 1)), columns], axis=2)
    signals = np.fft.irfft(padded, samples, axis=2) * math.sqrt(samples / 2.0)
    edges = np.linspace(0, min(math.ceil(samples * part), samples), BLOCKS + 1).astype(int)
    longest = int(np.max(np.diff(edges)))
    cut = np.zeros((signals.shape[1], BLOCKS, signals.shape[0], longest))
    for block, (low, high) in enumerate(pairwise(edges)):
        cut[:, block, :, : high - low] = signals[:, :, low:high].transpose(1, 0, 2)
    return cut
