"""Tolerances: deviations from the nominal values without a defect. A diagnosis fits them as
nuisance parameters and never reports them as findings."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rigtwin.components.guide import Guide, may_be_soft
from rigtwin.components.plant import P, Plant, parameter_of, select, with_parameters

MECHANICAL = ("mass", "stiffness", "constant", "coulomb", "viscous")
"""Parameters that change the motion itself, and not only its measurement."""
SOFTNESS = "softness"
"""Parameter of a guide: how far its dry friction is the soft one that MuJoCo simulates."""


@dataclass(frozen=True)
class Tolerance:
    """Declared tolerance of one parameter.

    Attributes
    ----------
    group
        Name of the component.
    parameter
        Name of the parameter.
    half_width
        Half width of the tolerance: in the parameter's unit, as a share of the nominal value, or
        in ticks.
    relative
        Whether the half width is a share of the nominal value.
    ticks
        Whether the half width is in ticks of the recording.
    longest
        Upper bound of a half width in ticks, s.
    is_declared
        Whether the description declares it. Other tolerances belong to every machine of its kind.
    """

    group: str
    parameter: str
    half_width: float
    relative: bool = False
    ticks: bool = False
    longest: float = math.inf
    is_declared: bool = True

    def width(self, plant: Plant, period: float = 1.0) -> float:
        """Return the half width in the parameter's unit.

        Parameters
        ----------
        plant
            Plant with the nominal value, which a relative tolerance refers to.
        period
            Period of a tick, s.
        """
        if self.ticks:
            return min(self.half_width * period, self.longest)
        nominal = parameter_of(plant, self.group, self.parameter) if self.relative else 1.0
        return self.half_width * abs(nominal)

    def shift(self, plant: P, amount: float) -> P:
        """Return a plant with the parameter increased by an amount, in the parameter's unit."""
        value = parameter_of(plant, self.group, self.parameter) + amount
        return with_parameters(plant, self.group, {self.parameter: value})

    def is_idle(self, plant: Plant) -> bool:
        """Return whether the parameter cannot change the prediction of a plant.

        Friction can be soft only where there is friction.
        """
        if self.parameter != SOFTNESS:
            return False
        (component,) = select(plant, [self.group])
        return isinstance(component, Guide) and not may_be_soft(component)

    @property
    def mechanical(self) -> bool:
        """Whether the parameter changes the motion itself, and not only its measurement."""
        return self.parameter in MECHANICAL
