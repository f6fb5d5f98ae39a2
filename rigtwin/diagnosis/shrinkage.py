"""Shrinkage of the gap by a correction, with its bootstrap interval.

The power of the residual is the mean over signals of ((y - p) / s)^2, where y is measured, p
predicted and s the signal's white noise. Noise and declared model error alone have the floor

    1 + (f std(y) / s)^2

with f the declared share. The shrinkage of a correction is the share of the gap's amplitude above
that floor which it closes:

    1 - sqrt(after - floor) / sqrt(before - floor).

Its interval is a block bootstrap: the residual is correlated in time, so that whole blocks and not
single ticks are drawn anew [Carlstein, Ann. Stat. 14 (1986) 1171].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.gap import Interval
from rigtwin.numerics.arrays import Array

BLOCK = 0.5
"""Length of a block of the bootstrap, s. The residual of a test is correlated within it."""
DRAWS = 1000
"""Number of draws of the bootstrap."""
GAP = 1.5
"""Ratio of a signal's power to that of noise and declared error from which it has a gap."""
SEED = 20
"""Seed of the bootstrap."""


@dataclass(frozen=True)
class Blocks:
    """Power of the residual in blocks of time, in units of the sensors' white noise.

    Attributes
    ----------
    before, after
        Power with the nominal and with the corrected plant, shape (blocks,).
    floor
        Power of noise and declared model error.
    """

    before: Array
    after: Array
    floor: float = 1.0


def power(evidence: Evidence, plant: Plant) -> list[Array]:
    """Return the power of the residual at every tick, averaged over the signals that count there.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    list of arrays
        Power in units of the sensors' white noise, shape (ticks,) for each recording.
    """
    powers = []
    for lines, predicted in zip(evidence.lines, evidence.predict(plant), strict=True):
        # A plant that diverges predicts values whose squares overflow. Infinite power is the right
        # answer.
        with np.errstate(over="ignore"):
            relative = (lines.measured - predicted) / lines.noise[:, None]
            total = np.sum(relative**2, axis=0, where=lines.counts)
            powers.append(total / np.maximum(lines.counts.sum(axis=0), 1))
    return powers


def gap_level(evidence: Evidence, plant: Plant) -> float:
    """Return the gap: the rms residual of all signals in units of their white noise.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    plant
        Plant whose predictions are compared.

    Returns
    -------
    float
        Gap over the ticks that count; 1 is noise alone.
    """
    powers = [
        ticks[lines.counts.any(axis=0)]
        for ticks, lines in zip(power(evidence, plant), evidence.lines, strict=True)
    ]
    count = sum(len(part) for part in powers)
    return math.sqrt(sum(float(part.sum()) for part in powers) / max(count, 1))


def declared_floor(evidence: Evidence) -> float:
    """Return the power of noise and declared model error, in units of the white noise's power."""
    return float(np.mean(signal_floors(evidence)))


def signal_floors(evidence: Evidence) -> Array:
    """Return the power of noise and declared model error of each signal.

    Parameters
    ----------
    evidence
        Recordings with their noise.

    Returns
    -------
    array
        Power in units of each signal's white noise, shape (recordings, signals).
    """
    forms = np.array([evidence.machine.form_of(row) for row in evidence.machine.rows])
    return np.stack(
        [
            1.0 + (forms * np.std(lines.measured, axis=1) / lines.noise) ** 2
            for lines in evidence.lines
        ]
    )


def largest_shrinkage(
    evidence: Evidence, before: Plant, after: Plant, optimism: float = 1.0
) -> float:
    """Return the share of the gap that a correction closes in the signal where it closes most.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    before, after
        Nominal and corrected plant.
    optimism
        Ratio of the residual's power on held-out data to that on the data of the fit. Defaults to
        1, for recordings that were not fitted.

    Returns
    -------
    float
        Shrinkage, at most 1. Signals without a gap before the correction do not count.
    """
    powers, floors = np.zeros((2, len(evidence.names))), np.zeros(len(evidence.names))
    for lines, floor, *predictions in zip(
        evidence.lines,
        signal_floors(evidence),
        evidence.predict(before),
        evidence.predict(after),
        strict=True,
    ):
        # Longer recordings count by their number of ticks, in the floor as in the powers.
        floors += lines.counts.sum(axis=1) * floor
        for number, predicted in enumerate(predictions):
            relative = (lines.measured - predicted) / lines.noise[:, None]
            powers[number] += lines.total(relative**2)
    # On the data of the fit the corrected residual is too small; see `cross_validation`.
    powers[1] *= optimism
    return max(
        (
            shrinkage(float(nominal), float(corrected), float(floor))
            for nominal, corrected, floor in zip(*powers, floors, strict=True)
            if nominal > GAP * floor
        ),
        default=0.0,
    )


def blocks(evidence: Evidence, before: Plant, after: Plant) -> Blocks:
    """Cut the residuals of two plants into blocks of time.

    Parameters
    ----------
    evidence
        Recordings that are predicted.
    before, after
        Nominal and corrected plant.

    Returns
    -------
    Blocks
        Mean power of each block in which at least half of the ticks count.
    """
    nominal_means: list[float] = []
    corrected_means: list[float] = []
    for recording, lines, nominal, corrected in zip(
        evidence.recordings,
        evidence.lines,
        power(evidence, before),
        power(evidence, after),
        strict=True,
    ):
        length = max(1, round(BLOCK / lines.period))
        # A short recording still gives several blocks to draw from.
        length = min(length, max(recording.ticks // 4, 1))
        counted = np.asarray(lines.counts.any(axis=0))
        # The incomplete block at the end is dropped: means of fewer ticks scatter more than the
        # others.
        for start in range(0, len(nominal) - length + 1, length):
            block, part = slice(start, start + length), counted[start : start + length]
            if np.mean(part) >= 0.5:
                nominal_means.append(float(np.mean(nominal[block][part])))
                corrected_means.append(float(np.mean(corrected[block][part])))
    return Blocks(np.array(nominal_means), np.array(corrected_means), declared_floor(evidence))


def shrinkage(before: float, after: float, floor: float = 1.0) -> float:
    """Return the share of the rms gap above the floor that is closed.

    Parameters
    ----------
    before, after
        Mean powers in units of the noise's power.
    floor
        Power of noise and declared error.

    Returns
    -------
    float
        At most 1; negative if the gap grows.
    """
    # Powers add and amplitudes do not, so the floor is subtracted before the root is taken.
    gap = math.sqrt(max(before - floor, 0.0))
    remainder = math.sqrt(max(after - floor, 0.0))
    return 1.0 - remainder / gap if gap > 0.0 else 0.0


def interval(residual: Blocks) -> Interval:
    """Return the shrinkage over all blocks with its 95 % bootstrap interval.

    Parameters
    ----------
    residual
        Power of the residual in blocks of time.

    Returns
    -------
    Interval
        Shrinkage with its interval; zeros if there is no block.
    """
    count = len(residual.before)
    if not count:
        return Interval(0.0, 0.0, 0.0)
    # The seed is fixed: the same recordings give the same answer.
    random = np.random.default_rng(SEED)
    # Drawn with replacement, as many blocks as there are.
    drawn = random.integers(0, count, (DRAWS, count))
    # Both residuals are drawn by the same blocks. What raises both, such as a fast part of the
    # motion, then cancels in their ratio.
    before, after = residual.before[drawn].mean(axis=1), residual.after[drawn].mean(axis=1)
    values = [shrinkage(b, a, residual.floor) for b, a in zip(before, after, strict=True)]
    # The percentiles of the draws serve as interval (Efron), since a ratio of square roots is
    # skewed and may be far from normal.
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(mean_shrinkage(residual), float(low), float(high))


def mean_shrinkage(residual: Blocks) -> float:
    """Return the shrinkage over all blocks; 0 if there is none."""
    if not len(residual.before):
        return 0.0
    before, after = float(residual.before.mean()), float(residual.after.mean())
    return shrinkage(before, after, residual.floor)
