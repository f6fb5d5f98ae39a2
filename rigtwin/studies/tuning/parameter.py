"""What a study may change: settings of the controller between bounds.

An optimiser sees each as a share, a number from 0 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigtwin.numerics.arrays import Array

DIGITS = 4
"""Significant digits of a tuned value. More have no meaning on a rig; what is written was tried."""


Settings = Any
"""A controller's settings: a NamedTuple, of whatever controller."""


@dataclass(frozen=True)
class Parameter:
    """One setting of the controller and its bounds.

    Parameters
    ----------
    key : str
        `controller.name`.
    low, high : float
        Bounds in its unit.
    logarithmic : bool
        Whether equal ratios, not equal differences, are equal steps.
    unit : str
        SI unit as text.
    """

    key: str
    low: float
    high: float
    logarithmic: bool
    unit: str

    @property
    def name(self) -> str:
        """The setting's name among the controller's."""
        return self.key.partition(".")[2]

    def value(self, share: float) -> float:
        """Value in its unit of a share of the way between the bounds, rounded to DIGITS."""
        value = self.low + share * (self.high - self.low)
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** share
        return min(max(float(f"{value:.{DIGITS - 1}e}"), self.low), self.high)

    def share(self, value: float) -> float:
        """Share of the way between the bounds of a value, or of the bound next to it."""
        inside = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(inside / self.low) / math.log(self.high / self.low)
        return (inside - self.low) / (self.high - self.low)


def values_at(parameters: Sequence[Parameter], shares: Array) -> tuple[float, ...]:
    """Value of every parameter at an optimiser's shares, shape (parameters,)."""
    pairs = zip(parameters, np.asarray(shares).tolist(), strict=True)
    return tuple(parameter.value(share) for parameter, share in pairs)


def set_values(
    settings: Settings,
    parameters: Sequence[Parameter],
    values: Sequence[float],
) -> Settings:
    """Set one value a parameter in the controller's settings."""
    pairs = zip(parameters, values, strict=True)
    return settings._replace(**{parameter.name: value for parameter, value in pairs})
