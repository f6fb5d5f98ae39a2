"""Prediction of blocks of samples that a linearised fit leaves out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigtwin.diagnosis.blocks import (
    BLOCKS,
    TINY,
)
from rigtwin.numerics.arrays import Array

FOLDS = 5
"""Number of sets of blocks that are held out in turn where there is one recording. The sets
interleave, so that each contains all directions and speeds of the motion."""
RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it."""


def _folds(recordings: int) -> list[NDArray[np.bool_]]:
    """Return the blocks that are held out in turn, shape (recordings, blocks) for each fold."""
    if recordings > 1:
        return [
            np.repeat(np.arange(recordings)[:, None] == number, BLOCKS, axis=1)
            for number in range(recordings)
        ]
    return [np.arange(BLOCKS)[None, :] % FOLDS == fold for fold in range(FOLDS)]


def cross_validate(
    products: Array, expected: Array, prior: Array, pull: Array
) -> tuple[Array, Array]:
    """Return the power of the held-out residual and of the whole fit, relative to the expected one.

    Parameters
    ----------
    products
        Products of all columns in every block, see `block_products`. The residual is the last
        column.
    expected
        Power of noise and declared error, shape (recordings, signals, bands, blocks).
    prior
        Prior precision of each parameter, shape (columns - 1,).
    pull
        Gradient of the prior at the values of the fit, shape (columns - 1,).

    Returns
    -------
    tuple of arrays
        Held-out and fitted power, shape (recordings, signals, bands) each.
    """
    count = products.shape[-1] - 1
    normal, gradient = products[..., :count, :count], products[..., :count, count]
    power = products[..., count, count]
    held_out = power.copy()
    if count:
        blocks, slopes = normal.sum(axis=(1, 2)), gradient.sum(axis=(1, 2))
        whole, right = blocks.sum(axis=(0, 1)), slopes.sum(axis=(0, 1))
        # A parameter without response, or with none in the remaining blocks, would make the matrix
        # singular.
        ridge = np.diag(prior + RIDGE * np.diag(whole) + 1e-12)
        # The move that all data ask for is subtracted from that of each fold. It is not 0 where the
        # residual is discontinuous, as at a stick: such a fit is no stationary point of its
        # linearisation.
        common = -np.linalg.solve(whole + ridge, right + pull)
        for fold in _folds(len(products)):
            remaining = whole - blocks[fold].sum(axis=0) + ridge
            slope = right - slopes[fold].sum(axis=0) + pull
            move = -np.linalg.solve(remaining, slope) - common
            # |r + J m|^2 = r'r + 2 (J'r)'m + m'J'J m, block by block.
            changed = power + 2.0 * gradient @ move + (normal @ move) @ move
            places = np.broadcast_to(fold[:, None, None, :], power.shape)
            held_out[places] = changed[places]
    total = expected.sum(axis=3)
    inverse = np.where(total > 0.0, 1.0 / np.maximum(total, TINY), 0.0)
    # The power of a single fold is a quadratic form, which rounding may make slightly negative.
    return np.maximum(held_out.sum(axis=3), 0.0) * inverse, power.sum(axis=3) * inverse


def normal_matrix(products: Array, prior: Array) -> Array:
    """Return the normal matrix of all data with the prior of the nuisances."""
    columns = products.shape[-1] - 1
    normal = products[..., :columns, :columns].sum(axis=(0, 1, 2, 3))
    return np.asarray(normal + np.diag(prior + RIDGE * np.diag(normal) + 1e-12))


def standard_errors(products: Array, expected: Array, prior: Array, count: int) -> Array:
    """Return the standard errors of the effects' parameters, in steps, shape (count,).

    The formal covariance is N^-1, scaled by the residual's excess over noise and declared error.
    The sandwich estimate is N^-1 S N^-1, where S is the scatter of the gradient over blocks; it is
    valid where neighbouring samples are correlated [White, Econometrica 48 (1980) 817].
    """
    columns = products.shape[-1] - 1
    inverse = np.linalg.inv(normal_matrix(products, prior))
    scores = products[..., :columns, columns].sum(axis=(1, 2)).reshape(-1, columns)
    blocks = len(scores)
    # The fitted columns use up degrees of freedom of the scatter.
    spread = scores.T @ scores * blocks / max(blocks - columns, 1)
    sandwich = inverse @ spread @ inverse
    excess = max(float(products[..., columns, columns].sum() / max(expected.sum(), TINY)), 1.0)
    # The sandwich scatters where there are few blocks, and the formal variance ignores correlation.
    # The larger one is the safer one.
    variance = np.maximum(np.diag(sandwich), np.diag(excess * inverse))[:count]
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
