"""Gas spring of a landing gear or of a cylinder with an accumulator: polytropic compression.

F(x) = F_0·(L / (L − x))^γ with the force F_0 at full extension, the length L of the gas column and
the polytropic exponent γ (thesis, eq. 3.3). The spring stiffens as it is compressed.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from controllers.compiled import compilable
from controllers.gas_spring import gas_force
from rigtwin.components.quantity import Quantity
from rigtwin.errors import RigtwinError


class GasSpring(NamedTuple):
    """Gas spring between carriage and plate, parallel to the motor.

    Zero travel is its full extension. The load cell sits on the motor's rod and does not measure
    this force.
    """

    force: Annotated[
        float,
        Quantity(
            "N",
            0.0,
            1e7,
            "fully extended, initial pressure times area; 0: the rig ran without, §3.2",
        ),
    ] = 0.0
    length: Annotated[
        float,
        Quantity(
            "m", 0.01, 10.0, "of the gas column, volume over area; 0.673 m at rig scale, §3.5"
        ),
    ] = 0.217
    exponent: Annotated[
        float, Quantity("1", 1.0, 1.7, "1 isothermal to 1.4 adiabatic air; thesis Eq. 3.3")
    ] = 1.4


class Charge(NamedTuple):
    """Gas charge of a cylinder with its accumulator."""

    pressure: float  # Pressure at full extension, above that on the rod's side, Pa.
    cylinder: float  # Volume swept over the stroke, m³.
    gas: float  # Volume of the gas at full extension, m³.


@compilable
def spring_force(spring: GasSpring, stroke: float) -> float:
    """Return the force F = F_0·(L/(L − x))^γ, N, at a compression x, m (thesis, eq. 3.3).

    F_0 is the initial pressure times the area. The force is infinite where x reaches L.
    """
    return gas_force(spring.force, spring.length, spring.exponent, stroke)


@compilable
def stiffness(spring: GasSpring, stroke: float) -> float:
    """Return the stiffness dF/dx = γ·F/(L − x), N/m, at a compression, m."""
    if stroke >= spring.length:
        return math.inf
    return spring.exponent * spring_force(spring, stroke) / (spring.length - stroke)


@compilable
def equilibrium(spring: GasSpring, load: float) -> float:
    """Return the compression under a load, m: x = L·(1 − (F_0/F)^(1/γ)).

    It is 0 where the load, N, does not exceed the force at full extension.
    """
    if load <= spring.force:
        return 0.0
    return spring.length * (1.0 - (spring.force / load) ** (1.0 / spring.exponent))


def design(extended: float, compressed: float, stroke: float, exponent: float) -> GasSpring:
    """Return the spring that has two given forces.

    Parameters
    ----------
    extended, compressed
        Forces fully extended and compressed by the stroke, N.
    stroke
        Stroke, m.
    exponent
        Polytropic exponent.

    Returns
    -------
    GasSpring
        Spring with L = stroke·r/(r − 1), where r = (compressed/extended)^(1/exponent).

    Raises
    ------
    RigtwinError
        If a value is not positive, or the compressed force is not the greater one.
    """
    _positive(
        ("force fully extended", extended, "N"), ("stroke", stroke, "m"), ("exponent", exponent, "")
    )
    if not (math.isfinite(compressed) and compressed > extended):
        raise RigtwinError(
            f"force of the compressed gas spring is {compressed:g} N; expected more than "
            f"the {extended:g} N of the extended one"
        )
    ratio = (compressed / extended) ** (1.0 / exponent)
    return GasSpring(extended, stroke * ratio / (ratio - 1.0), exponent)


def find_charge(spring: GasSpring, area: float, stroke: float) -> Charge:
    """Return the gas charge that makes a cylinder this spring.

    Parameters
    ----------
    spring
        Spring to be made.
    area
        Area of the piston A, m².
    stroke
        Stroke of the cylinder, m.

    Returns
    -------
    Charge
        Pressure F_0/A, swept volume A·stroke and gas volume A·L.

    Raises
    ------
    RigtwinError
        If a value is not positive, or the stroke reaches the length of the gas column.
    """
    _positive(("area", area, "m²"), ("stroke", stroke, "m"))
    if stroke >= spring.length:
        raise RigtwinError(
            f"stroke of the gas spring is {stroke:g} m; "
            f"expected less than its gas column of {spring.length:g} m"
        )
    return Charge(spring.force / area, area * stroke, area * spring.length)


def _positive(*quantities: tuple[str, float, str]) -> None:
    for name, value, unit in quantities:
        if not (math.isfinite(value) and value > 0.0):
            raise RigtwinError(
                f"{name} of the gas spring is {f'{value:g} {unit}'.strip()}; "
                "expected a positive, finite number"
            )
