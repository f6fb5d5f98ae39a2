"""What is left of a comparison, beside what noise alone would leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import band, rms

SIGNIFICANT_DIGITS = 8
"""Digits to which recordings in text keep a command; a controller that agrees to them is exact."""


@dataclass(frozen=True)
class Residual:
    """What is left of one comparison. residual: rms, its mean in, the mains line out; noise_floor:
    what the sensors' white noise alone would leave; ratio: of the two; band_hz: where the middle 80
    % of the residual's power lies. unit "1": several outputs together, each in units of its own
    noise floor, and `outputs` has them apart."""

    residual: float
    noise_floor: float
    ratio: float
    unit: str
    band_hz: tuple[float, float]
    outputs: dict[str, Residual] = field(default_factory=dict)


def compute_residual(difference: Array, floor: float, unit: str, period: float) -> Residual:
    """The residual of one output."""
    left = rms(difference)
    return Residual(
        left, floor, left / floor if floor > 0 else math.inf, unit, band(difference, period)
    )


def combine_residuals(
    outputs: dict[str, Residual], differences: dict[str, Array], period: float
) -> Residual:
    """Several outputs as one, each in units of its own noise floor."""
    ratio = math.hypot(*(output.ratio for output in outputs.values())) / math.sqrt(len(outputs))
    loudest = max(outputs, key=lambda name: outputs[name].ratio)
    return Residual(ratio, 1.0, ratio, "1", band(differences[loudest], period), outputs)


def rounding(recorded: Array) -> float:
    """rms error of a column kept to eight significant digits of its largest value; 1e-12 of a unit
    for a column of zeros."""
    largest = float(np.max(np.abs(recorded)))
    # Eight digits below that the smallest numbers of a computer begin.
    if largest < 1e-290:
        return 1e-12
    return float(
        10.0 ** (math.floor(math.log10(largest)) + 1 - SIGNIFICANT_DIGITS) / math.sqrt(12.0)
    )
