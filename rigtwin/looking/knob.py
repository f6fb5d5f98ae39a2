"""Appearance of a slider on a page: its scale, and the digits shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rigtwin.looking.scale import shorten
from rigtwin.looking.slider import Slider

POSITIONS = 400
"""Minimum number of positions of a slider."""
WIDE = 30.0
"""Ratio of the ends of a positive range from which the scale is logarithmic."""


@dataclass(frozen=True)
class Knob:
    """Scale of a slider.

    Attributes
    ----------
    slider
        Parameter and range.
    low, high, step
        Range and step of the positions.
    logarithmic
        Whether positions are decimal logarithms of values.
    factor
        Factor from values to positions of a linear scale.
    unit
        Unit of the positions of a linear scale.
    """

    slider: Slider
    low: float
    high: float
    step: float
    logarithmic: bool
    factor: float
    unit: str

    def label(self, value: float) -> str:
        """Return the slider's label; on a logarithmic scale it contains the value."""
        name = self.slider.parameter
        if self.logarithmic:
            return f"{name} {value:.3g} {self.unit}".strip()
        return f"{name}, {self.unit}" if self.unit else name

    @property
    def ends(self) -> tuple[str, str]:
        """Texts below both ends, in the unit of `label`."""
        scale = 1.0 if self.logarithmic else self.factor
        return f"{scale * self.slider.low:.4g}", f"{scale * self.slider.high:.4g}"

    def position(self, value: float) -> float:
        """Return the position of a value; values out of range are at an end."""
        # A value without a nominal, such as an absent limit, is shown at the lower end.
        if math.isnan(value):
            return self.low
        inside = min(max(value, self.slider.low), self.slider.high)
        scaled = math.log10(inside) if self.logarithmic else self.factor * inside
        return min(max(scaled, self.low), self.high)

    def value(self, position: float) -> float:
        """Return the value of a position, in the slider's unit and within its range."""
        meant = 10.0**position if self.logarithmic else position / self.factor
        # Rounding of a logarithm may lead beyond the ends.
        return min(max(meant, self.slider.low), self.slider.high)


def knob_of(slider: Slider) -> Knob:
    """Return the scale of a slider.

    A wide positive range has a logarithmic scale. Long numbers are shown in thousandths, or other
    powers of the unit.
    """
    # A logarithm needs positive values, and pays only over a wide range.
    if slider.low > 0.0 and slider.high > WIDE * slider.low:
        low, high = math.log10(slider.low), math.log10(slider.high)
        unit = "" if slider.unit == "1" else slider.unit
        return Knob(
            slider=slider,
            low=low,
            high=high,
            step=_step(low, high),
            logarithmic=True,
            factor=1.0,
            unit=unit,
        )
    factor, unit = shorten(max(abs(slider.low), abs(slider.high)), slider.unit)
    low, high = factor * slider.low, factor * slider.high
    return Knob(
        slider=slider,
        low=low,
        high=high,
        step=_step(low, high),
        logarithmic=False,
        factor=factor,
        unit=unit,
    )


def _step(low: float, high: float) -> float:
    """Return the largest power of ten that leaves enough positions."""
    return 10.0 ** math.floor(math.log10((high - low) / POSITIONS))
