"""The linear vehicles whose loops are studied (thesis Figure 5.1 and §5.3.1)."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

from rigtwin.errors import RigtwinError

SMALLEST, LARGEST = 1e-9, 1e12
"""kg, N/m and Ns/m: what can be computed at all."""
LEAST, MOST = (
    {"mass": 1e-3, "stiffness": 1e-3, "damping": 1e-6},
    {"mass": 1e6, "stiffness": 1e9, "damping": 1e9},
)
"""kg, N/m and Ns/m: beyond these rounding may decide which pole is stable."""
SHORTEST, LONGEST = 1e-9, 1e6
"""s."""


class SingleMass(NamedTuple):
    """A mass on a spring and a damper: kg, N/m, Ns/m."""

    mass: float
    stiffness: float
    damping: float

    @property
    def natural_frequency(self) -> float:
        """Undamped, rad/s."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping (Eq. 5.34)."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.mass))


class QuarterCar(NamedTuple):
    """Tyre stiffness N/m and damping Ns/m, unsprung mass kg, suspension stiffness N/m and damping
    Ns/m, sprung mass kg."""

    tyre_stiffness: float
    tyre_damping: float
    unsprung_mass: float
    suspension_stiffness: float
    suspension_damping: float
    sprung_mass: float

    @property
    def sprung(self) -> SingleMass:
        """The sprung mass on its suspension alone, the wheel held still."""
        return SingleMass(self.sprung_mass, self.suspension_stiffness, self.suspension_damping)

    @property
    def unsprung(self) -> SingleMass:
        """The unsprung mass on its tyre alone, the suspension taken away."""
        return SingleMass(self.unsprung_mass, self.tyre_stiffness, self.tyre_damping)


Vehicle = TypeVar("Vehicle", SingleMass, QuarterCar)


def validate(vehicle: Vehicle) -> Vehicle:
    """The vehicle. Raises RigtwinError unless masses and stiffnesses are above 0 and dampings 0 or
    more."""
    for name, value in vehicle._asdict().items():
        _within(name, value, SMALLEST, LARGEST)
    return vehicle


def believable(vehicle: Vehicle) -> Vehicle:
    """The vehicle. Raises RigtwinError unless it is of a size at which its poles can be told from
    rounding."""
    for name, value in vehicle._asdict().items():
        kind = name.rpartition("_")[2]
        _within(name, value, LEAST[kind], MOST[kind])
    return vehicle


def _within(name: str, value: float, low: float, high: float) -> None:
    damping = name.endswith("damping")
    if not (low <= value <= high or (damping and value == 0.0)):
        raise RigtwinError(
            f"{name} {value:g}: expected {'0, or ' if damping else ''}{low:g} to {high:g}",
        )


def checked_time(name: str, value: float) -> float:
    """A lag or a delay, s. Raises RigtwinError unless it is above 0 and of a size that poles can be
    told apart at."""
    if not SHORTEST <= value <= LONGEST:
        raise RigtwinError(f"{name} {value:g}: expected {SHORTEST:g} to {LONGEST:g} s")
    return value
