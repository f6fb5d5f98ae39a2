"""An aircraft's quarter on a gas spring that touches down: thesis Eq. 3.4 and 3.5."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from controllers.quantity import Quantity
from rigtwin.components.gas_spring import GasSpring, spring_force, stiffness
from rigtwin.numerics.arrays import Array

_TABLE = "thesis Table 3.1"
_LIFT = "the wings carry the aircraft at touch-down and let go within a second, assumed"


class Landing(NamedTuple):
    """A quarter car with a gas spring that touches down: thesis Eq. 3.4 and 3.5, with the exponent
    that they lack, a tyre that stands on the ground and only pushes, the wheel's weight, and a stop
    where the strut is fully extended."""

    sprung_mass: Annotated[float, Quantity("kg", 1.0, 1e6, _TABLE)] = 68_210.0
    unsprung_mass: Annotated[float, Quantity("kg", 0.1, 1e5, _TABLE)] = 1140.0
    damping: Annotated[float, Quantity("Ns/m", 0.0, 1e7, _TABLE)] = 105_400.0
    tyre_stiffness: Annotated[float, Quantity("N/m", 1e2, 1e9, _TABLE)] = 8_461_000.0
    gas_force: Annotated[float, Quantity("N", 1.0, 1e7, "thesis §3.5")] = 167_285.0
    gas_length: Annotated[float, Quantity("m", 0.01, 10.0, "thesis §3.5")] = 0.673
    exponent: Annotated[
        float, Quantity("1", 1.0, 2.0, "adiabatic air; it reproduces the printed stiffness")
    ] = 1.4
    stop_stiffness: Annotated[
        float, Quantity("N/m", 0.0, 1e10, "ten times the tyre's and more, assumed")
    ] = 1e8
    gravity: Annotated[float, Quantity("m/s^2", 0.0, 30.0, "standard")] = 9.81
    velocity: Annotated[float, Quantity("m/s", 0.0, 10.0, "thesis Table 3.2")] = 3.0
    lift: Annotated[
        float, Quantity("1", 0.0, 1.0, "1 at touch-down, a share of the weight; " + _LIFT)
    ] = 1.0
    lift_time: Annotated[
        float, Quantity("s", 0.01, 100.0, "time constant of its decay; " + _LIFT)
    ] = 1.0

    @property
    def spring(self) -> GasSpring:
        return GasSpring(self.gas_force, self.gas_length, self.exponent)


def touch_down(landing: Landing, instants: Array) -> Array:
    """Compression of the strut, m, velocity of the sprung mass, m/s, force of gas and damper, N;
    shape (3, instants)."""
    spring, weight = landing.spring, landing.sprung_mass + landing.unsprung_mass

    def between(travel: float, speed: float) -> float:
        return spring_force(spring, travel) + landing.damping * speed

    def change(time: float, state: Array) -> list[float]:
        body, wheel, body_velocity, wheel_velocity = state.tolist()
        strut = between(
            wheel - body, wheel_velocity - body_velocity
        ) + landing.stop_stiffness * min(wheel - body, 0.0)
        lift = landing.lift * weight * landing.gravity * math.exp(-time / landing.lift_time)
        tyre = max(-landing.tyre_stiffness * wheel, 0.0)
        return [
            body_velocity,
            wheel_velocity,
            (strut + lift) / landing.sprung_mass - landing.gravity,
            (tyre - strut) / landing.unsprung_mass - landing.gravity,
        ]

    # In flight the gas presses the wheel, and its weight pulls it, against the stop.
    hanging = (landing.gas_force + landing.unsprung_mass * landing.gravity) / (
        landing.stop_stiffness + stiffness(spring, 0.0)
    )
    start = [hanging, 0.0, -landing.velocity, -landing.velocity]
    span = (float(instants[0]), float(instants[-1]))
    run = solve_ivp(
        change, span, start, "DOP853", instants, rtol=1e-9, atol=1e-11, max_step=span[1] / 100.0
    )
    body, wheel, body_velocity, wheel_velocity = run.y
    travel = wheel - body
    pushed = [
        between(x, v)
        for x, v in zip(travel.tolist(), (wheel_velocity - body_velocity).tolist(), strict=True)
    ]
    return np.array([travel, body_velocity, pushed])
