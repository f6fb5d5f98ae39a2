"""Residual of a comparison, beside the residual that noise alone would leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import band, rms

SIGNIFICANT_DIGITS = 8
"""Significant digits of a command in a recording stored as text. A replayed controller that agrees
to them counts as exact."""


@dataclass(frozen=True)
class Residual:
    """Residual of one comparison.

    Attributes
    ----------
    residual
        rms of the difference with its mean and without the mains line, in `unit`.
    noise_floor
        rms that the sensors' white noise alone would leave, in `unit`.
    ratio
        Ratio of residual to noise floor.
    unit
        Unit of the signal; "1" for several outputs combined, each in units of its noise floor.
    band_hz
        Band with the middle 80 % of the residual's power, Hz.
    outputs
        Residual of each output, by name, where several are combined.
    """

    residual: float
    noise_floor: float
    ratio: float
    unit: str
    band_hz: tuple[float, float]
    outputs: dict[str, Residual] = field(default_factory=dict)


def compute_residual(difference: Array, floor: float, unit: str, period: float) -> Residual:
    """Return the residual of one output.

    Parameters
    ----------
    difference
        Measured less predicted signal, in `unit`, shape (ticks,).
    floor
        Noise floor, in `unit`.
    unit
        Unit of the signal.
    period
        Time from tick to tick, s.

    Returns
    -------
    Residual
        rms of the difference; the ratio is infinite if the floor is 0.
    """
    residual = rms(difference)
    ratio = residual / floor if floor > 0 else math.inf
    return Residual(residual, floor, ratio, unit, band(difference, period))


def combine_residuals(
    outputs: dict[str, Residual], differences: dict[str, Array], period: float
) -> Residual:
    """Several outputs as one, each in units of its own noise floor."""
    # Root mean square of the ratios: in units of their noise floors, outputs of different units
    # add.
    ratio = math.hypot(*(output.ratio for output in outputs.values())) / math.sqrt(len(outputs))
    # The band is that of the output with the largest ratio, since spectra of different units cannot
    # be added.
    loudest = max(outputs, key=lambda name: outputs[name].ratio)
    return Residual(ratio, 1.0, ratio, "1", band(differences[loudest], period), outputs)


def rounding(recorded: Array) -> float:
    """Return the rms rounding error of a column stored with eight significant digits.

    Parameters
    ----------
    recorded
        Values of the column, shape (ticks,).

    Returns
    -------
    float
        q / sqrt(12), where q is the last stored digit of the largest value; 1e-12 for a column of
        zeros.
    """
    # Smaller values are stored with smaller steps, so the largest one gives an upper bound.
    largest = float(np.max(np.abs(recorded)))
    # Eight digits below that the smallest numbers of a computer begin.
    if largest < 1e-290:
        return 1e-12
    return float(
        10.0 ** (math.floor(math.log10(largest)) + 1 - SIGNIFICANT_DIGITS) / math.sqrt(12.0)
    )
