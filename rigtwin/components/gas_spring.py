"""Gas spring of a landing gear or of a cylinder with an accumulator (thesis Eq. 3.3): polytropic
compression, stiffening."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from controllers.compiled import compilable
from controllers.gas_spring import gas_force
from rigtwin.components.quantity import Quantity
from rigtwin.errors import RigtwinError


class GasSpring(NamedTuple):
    """A real gas spring beside the motor, between carriage and plate; the load cell is on the
    motor's rod and does not feel it. Travel 0 is its full extension."""

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
    """What fills a cylinder and its accumulator. pressure: fully extended, above that on the rod's
    side, Pa; cylinder: volume swept over the stroke, m³; gas: volume fully extended, m³."""

    pressure: float
    cylinder: float
    gas: float


@compilable
def spring_force(spring: GasSpring, stroke: float) -> float:
    """F = P_i A_g (L/(L − x))^γ, N, at a compression x, m (Eq. 3.3); infinite where no room is left
    for the gas."""
    return gas_force(spring.force, spring.length, spring.exponent, stroke)


@compilable
def stiffness(spring: GasSpring, stroke: float) -> float:
    """dF/dx = γ F/(L − x), N/m."""
    if stroke >= spring.length:
        return math.inf
    return spring.exponent * spring_force(spring, stroke) / (spring.length - stroke)


@compilable
def equilibrium(spring: GasSpring, load: float) -> float:
    """Compression under a load of N, m; 0 where the load does not exceed the force of the fully
    extended spring."""
    if load <= spring.force:
        return 0.0
    return spring.length * (1.0 - (spring.force / load) ** (1.0 / spring.exponent))


def design(extended: float, compressed: float, stroke: float, exponent: float) -> GasSpring:
    """The spring of those forces, N, fully extended and compressed by the stroke, m."""
    _positive(
        ("force fully extended", extended, "N"), ("stroke", stroke, "m"), ("exponent", exponent, "")
    )
    if not (math.isfinite(compressed) and compressed > extended):
        raise RigtwinError(
            f"the force compressed, {compressed:g} N, has to exceed "
            f"the one fully extended, {extended:g} N"
        )
    ratio = (compressed / extended) ** (1.0 / exponent)
    return GasSpring(extended, stroke * ratio / (ratio - 1.0), exponent)


def find_charge(spring: GasSpring, area: float, stroke: float) -> Charge:
    """The charge that makes a cylinder of that area, m², and stroke, m, this spring: pressure F/A,
    gas volume A L."""
    _positive(("area", area, "m²"), ("stroke", stroke, "m"))
    if stroke >= spring.length:
        raise RigtwinError(
            f"a stroke of {stroke:g} m leaves no room in a gas column of {spring.length:g} m"
        )
    return Charge(spring.force / area, area * stroke, area * spring.length)


def _positive(*given: tuple[str, float, str]) -> None:
    for name, value, unit in given:
        if not (math.isfinite(value) and value > 0.0):
            raise RigtwinError(
                f"the {name} of a gas spring is {f'{value:g} {unit}'.strip()}; "
                "it has to be positive and finite"
            )
