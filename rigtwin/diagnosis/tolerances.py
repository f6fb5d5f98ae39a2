"""What a rig may differ in without anything being wrong: every tolerance is a nuisance to the diagnosis, never a finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigtwin.parameters import Plant


@dataclass(frozen=True)
class Tolerance:
    """A declared tolerance of one parameter. of: the group and parameter; half_width: in the parameter's unit, or as a
    share of its value if relative."""

    group: str
    parameter: str
    half_width: float
    relative: bool = False

    def width(self, plant: Plant) -> float:
        """Its half width in the parameter's unit, at that plant."""
        return self.half_width * (abs(float(getattr(getattr(plant, self.group), self.parameter))) if self.relative else 1.0)

    def shifted(self, plant: Plant, amount: float) -> Plant:
        """The plant with this parameter higher by that much, in its unit."""
        group = getattr(plant, self.group)
        value = float(getattr(group, self.parameter)) + amount
        return plant._replace(**{self.group: group._replace(**{self.parameter: value})})

    @property
    def mechanical(self) -> bool:
        """Whether it changes the motion itself, and not only when or how it is sensed."""
        return self.parameter in ("mass", "stiffness", "constant", "coulomb")


LVDTS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt")
TIMING = 1e-4
"""s, of every path."""
TOLERANCES = (
    Tolerance("carriage", "mass", 0.005, True),
    Tolerance("tyre", "stiffness", 0.01, True),
    Tolerance("motor", "constant", 0.005, True),
    Tolerance("rail", "coulomb", 0.03, True),
    Tolerance("motor", "coulomb", 0.03, True),
    *(Tolerance(sensor, "gain", 0.002, True) for sensor in (*LVDTS, "load_cell")),
    *(Tolerance(sensor, "offset", 5e-5) for sensor in LVDTS),
    Tolerance("load_cell", "offset", 0.5),
    *(Tolerance(path, "delay", TIMING) for path in ("motor", "ground_cylinder", "structure_cylinder", *LVDTS, "load_cell")),
)
"""The suspension rig's: masses, stiffness, motor constant, friction, sensors, timing of each path."""


def shifted(plant: Plant, nominal: Plant, widths: Sequence[float]) -> Plant:
    """The plant with each tolerance used by so many half widths, those of the nominal plant."""
    for tolerance, share in zip(TOLERANCES, widths, strict=True):
        if share:
            plant = tolerance.shifted(plant, share * tolerance.width(nominal))
    return plant


SAME = {("motor", "gain"): "constant"}
"""(Group, parameter) → the parameter that has the same meaning and the declared tolerance."""


def tolerance_of(group: str, parameter: str) -> Tolerance | None:
    """The declared tolerance of a parameter, or of one that means the same, if there is one."""
    wanted = (group, SAME.get((group, parameter), parameter))
    return next((each for each in TOLERANCES if (each.group, each.parameter) == wanted), None)
