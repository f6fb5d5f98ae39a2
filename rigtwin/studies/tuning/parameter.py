"""Tuning parameters: settings of the controller between bounds.

An optimiser sees a parameter as a share, a number from 0 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigtwin.numerics.arrays import Array

DIGITS = 4
"""Significant digits of a tuned value. The rounded value is the one that is simulated and written;
further digits would have no meaning on a rig."""


Settings = Any
"""Settings of any controller, a NamedTuple."""


@dataclass(frozen=True)
class TuningParameter:
    """Setting of the controller and its bounds.

    Parameters
    ----------
    key : str
        Key of the setting, `controller.name`.
    low, high : float
        Bounds in the setting's unit.
    logarithmic : bool
        Whether equal shares are equal ratios instead of equal differences.
    unit : str
        SI unit of the setting.
    """

    key: str
    low: float
    high: float
    logarithmic: bool
    unit: str

    @property
    def name(self) -> str:
        """Name of the setting within the controller's settings."""
        return self.key.partition(".")[2]

    def value(self, share: float) -> float:
        """Return the value at a share of the way between the bounds, rounded to DIGITS."""
        value = self.low + share * (self.high - self.low)
        if self.logarithmic:
            # Equal shares are equal ratios on a logarithmic scale.
            value = self.low * (self.high / self.low) ** share
        # Rounding may leave the bounds by half a digit.
        return min(max(float(f"{value:.{DIGITS - 1}e}"), self.low), self.high)

    def share(self, value: float) -> float:
        """Return the share of a value; a value out of bounds has the share of the nearest bound."""
        inside = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(inside / self.low) / math.log(self.high / self.low)
        return (inside - self.low) / (self.high - self.low)


def values_at(parameters: Sequence[TuningParameter], shares: Array) -> tuple[float, ...]:
    """Return the value of every parameter at an optimiser's shares, shape (parameters,)."""
    pairs = zip(parameters, np.asarray(shares).tolist(), strict=True)
    return tuple(parameter.value(share) for parameter, share in pairs)


def set_values(
    settings: Settings, parameters: Sequence[TuningParameter], values: Sequence[float]
) -> Settings:
    """Return the controller's settings with one value set per parameter."""
    pairs = zip(parameters, values, strict=True)
    return settings._replace(**{parameter.name: value for parameter, value in pairs})
