"""Linear vehicles of the stability studies (thesis Figure 5.1 and §5.3.1)."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

from rigtwin.errors import RigtwinError

SMALLEST, LARGEST = 1e-9, 1e12
"""Range of masses, stiffnesses and dampings, in kg, N/m and Ns/m, that can be computed."""
LEAST, MOST = (
    {"mass": 1e-3, "stiffness": 1e-3, "damping": 1e-6},
    {"mass": 1e6, "stiffness": 1e9, "damping": 1e9},
)
"""Range of plausible values, in kg, N/m and Ns/m. Beyond it rounding may decide which pole is
stable."""
SHORTEST, LONGEST = 1e-9, 1e6
"""Range of lags and delays, in s."""


class SingleMass(NamedTuple):
    """Mass on a spring and a damper, in kg, N/m and Ns/m."""

    mass: float
    stiffness: float
    damping: float

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency, in rad/s."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Ratio of the damping to critical damping (Eq. 5.34)."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.mass))


class QuarterCar(NamedTuple):
    """Quarter car: masses in kg, stiffnesses in N/m, dampings in Ns/m."""

    tyre_stiffness: float
    tyre_damping: float
    unsprung_mass: float
    suspension_stiffness: float
    suspension_damping: float
    sprung_mass: float

    @property
    def sprung(self) -> SingleMass:
        """Sprung mass on its suspension alone, with the wheel held."""
        return SingleMass(self.sprung_mass, self.suspension_stiffness, self.suspension_damping)

    @property
    def unsprung(self) -> SingleMass:
        """Unsprung mass on its tyre alone, without the suspension."""
        return SingleMass(self.unsprung_mass, self.tyre_stiffness, self.tyre_damping)


Vehicle = TypeVar("Vehicle", SingleMass, QuarterCar)


def validate(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle unchanged if it can be computed.

    Raises
    ------
    RigtwinError
        If a mass or stiffness is not positive, or a damping is negative.
    """
    for name, value in vehicle._asdict().items():
        _within(name, value, SMALLEST, LARGEST)
    return vehicle


def check_plausible(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle unchanged if its size is plausible.

    Raises
    ------
    RigtwinError
        If a value is so extreme that rounding may decide the sign of a pole.
    """
    # The last word of a field's name is its kind of quantity: sprung_mass, tyre_damping.
    for name, value in vehicle._asdict().items():
        kind = name.rpartition("_")[2]
        _within(name, value, LEAST[kind], MOST[kind])
    return vehicle


def _within(name: str, value: float, low: float, high: float) -> None:
    """Raise RigtwinError unless a value is in its range; a damping may also be 0."""
    damping = name.endswith("damping")
    if not (low <= value <= high or (damping and value == 0.0)):
        raise RigtwinError(
            f"{name} {value:g}: expected {'0, or ' if damping else ''}{low:g} to {high:g}"
        )


def check_time(name: str, value: float) -> float:
    """Return a lag or delay, in s, unchanged if poles can be computed with it.

    Raises
    ------
    RigtwinError
        If the time is not positive, or so extreme that poles cannot be resolved.
    """

    if not SHORTEST <= value <= LONGEST:
        raise RigtwinError(f"{name} {value:g}: expected {SHORTEST:g} to {LONGEST:g} s")
    return value
