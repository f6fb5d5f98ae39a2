"""A slider as it stands on a page: its scale and the digits that are shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rigtwin.looking.scale import shorten
from rigtwin.looking.slider import Slider

POSITIONS = 400
"""Of a slider, at least so many."""
WIDE = 30.0
"""Ratio of a positive range's ends from which its scale is logarithmic."""


@dataclass(frozen=True)
class Knob:
    """low, high, step: of the positions; logarithmic: whether positions are decimal logarithms;
    factor: what a value is multiplied by where they are not; unit: of the positions then."""

    slider: Slider
    low: float
    high: float
    step: float
    logarithmic: bool
    factor: float
    unit: str

    def label(self, value: float) -> str:
        """What is written beside it: of a logarithm, the value itself too."""
        name = self.slider.parameter
        if self.logarithmic:
            return f"{name} {value:.3g} {self.unit}".strip()
        return f"{name}, {self.unit}" if self.unit else name

    @property
    def ends(self) -> tuple[str, str]:
        """What is written under its ends, in the unit of `label`."""
        scale = 1.0 if self.logarithmic else self.factor
        return f"{scale * self.slider.low:.4g}", f"{scale * self.slider.high:.4g}"

    def position(self, value: float) -> float:
        """Where a value is, at an end if it is beyond."""
        if math.isnan(value):
            return self.low
        inside = min(max(value, self.slider.low), self.slider.high)
        scaled = math.log10(inside) if self.logarithmic else self.factor * inside
        return min(max(scaled, self.low), self.high)

    def value(self, position: float) -> float:
        """What a position means, in the slider's unit and within its range."""
        meant = 10.0**position if self.logarithmic else position / self.factor
        return min(max(meant, self.slider.low), self.slider.high)


def knob_of(slider: Slider) -> Knob:
    """The scale of a slider: logarithmic where all of a wide range is positive, in thousandths or
    other powers of the unit where its numbers would be long."""
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
    """A power of ten that leaves enough positions."""
    return 10.0 ** math.floor(math.log10((high - low) / POSITIONS))
