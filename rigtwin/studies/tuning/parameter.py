"""What a study may change: settings of the controller between bounds, seen by an optimiser as numbers from 0 to 1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers import Settings
from rigtwin.numerics.arrays import Array

DIGITS = 4
"""Significant digits of a tuned value; more have no meaning on a rig, and what is written is what was tried."""


@dataclass(frozen=True)
class Parameter:
    """One setting, `controller.name`, from low to high in its unit; logarithmic: equal ratios are equal steps."""

    key: str
    low: float
    high: float
    logarithmic: bool
    unit: str

    def value(self, share: float) -> float:
        """In its unit, of a number from 0 to 1."""
        width = self.high - self.low
        value = self.low * (self.high / self.low) ** share if self.logarithmic else self.low + share * width
        return min(max(float(f"{value:.{DIGITS - 1}e}"), self.low), self.high)

    def share(self, value: float) -> float:
        """The number from 0 to 1 of a value, or of the bound next to it."""
        inside = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(inside / self.low) / math.log(self.high / self.low)
        return (inside - self.low) / (self.high - self.low)


def values(parameters: Sequence[Parameter], shares: Array) -> tuple[float, ...]:
    """One value a parameter, of the optimiser's numbers, shape (parameters,)."""
    return tuple(parameter.value(share) for parameter, share in zip(parameters, np.asarray(shares).tolist(), strict=True))


def with_values(settings: Settings, parameters: Sequence[Parameter], chosen: Sequence[float]) -> Settings:
    """The controller's settings with these values, one a parameter."""
    return settings._replace(
        **{parameter.key.partition(".")[2]: value for parameter, value in zip(parameters, chosen, strict=True)}
    )
