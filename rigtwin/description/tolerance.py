"""What a machine may differ in without anything being wrong: every tolerance is a nuisance to a
diagnosis, never a finding."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rigtwin.components.plant import P, Plant

MECHANICAL = ("mass", "stiffness", "constant", "coulomb", "viscous")
"""Parameters that change the motion itself, and not only when or how it is sensed."""


@dataclass(frozen=True)
class Tolerance:
    """A declared tolerance of one parameter. group: the component; half_width: in the parameter's
    unit, or as a share of its value if relative, or in ticks, but no more than `longest`, s."""

    group: str
    parameter: str
    half_width: float
    relative: bool = False
    ticks: bool = False
    longest: float = math.inf

    def width(self, plant: Plant, period: float = 1.0) -> float:
        """Its half width in the parameter's unit, at that plant. period: s, of a tick."""
        if self.ticks:
            return min(self.half_width * period, self.longest)
        return self.half_width * (
            abs(float(getattr(getattr(plant, self.group), self.parameter)))
            if self.relative
            else 1.0
        )

    def shift(self, plant: P, amount: float) -> P:
        """The plant with this parameter higher by that much, in its unit."""
        group = getattr(plant, self.group)
        value = float(getattr(group, self.parameter)) + amount
        return plant._replace(**{self.group: group._replace(**{self.parameter: value})})

    @property
    def mechanical(self) -> bool:
        return self.parameter in MECHANICAL
