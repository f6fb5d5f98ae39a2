"""Touch-down of a quarter aircraft on a gas spring: thesis Eq. 3.4 and 3.5."""

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
    """Parameters of a quarter aircraft that touches down: thesis Eq. 3.4 and 3.5, corrected.

    The equations lack the exponent γ of the gas and the weight of the wheel. Here the tyre stands
    on the ground and only pushes, and a stop limits the extension of the strut. Units and sources
    stand in the types.
    """

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
        """Gas spring of the strut."""
        return GasSpring(self.gas_force, self.gas_length, self.exponent)


def touch_down(landing: Landing, instants: Array) -> Array:
    """Simulate a touch-down.

    Parameters
    ----------
    landing : Landing
        Parameters of the aircraft.
    instants : ndarray
        Times after the touch-down, s, shape (n,), ascending from 0.

    Returns
    -------
    ndarray
        Compression of the strut, m, velocity of the sprung mass, m/s, and force of gas spring and
        damper, N, shape (3, n).
    """
    spring, weight = landing.spring, landing.sprung_mass + landing.unsprung_mass

    def strut_force(travel: float, speed: float) -> float:
        return spring_force(spring, travel) + landing.damping * speed

    def derivative(time: float, state: Array) -> list[float]:
        # Heights above the ground at touch-down, m; both masses start with the sinking speed.
        body, wheel, body_velocity, wheel_velocity = state.tolist()
        # The stop acts only where the strut would extend beyond its length.
        strut = strut_force(
            wheel - body, wheel_velocity - body_velocity
        ) + landing.stop_stiffness * min(wheel - body, 0.0)
        lift = landing.lift * weight * landing.gravity * math.exp(-time / landing.lift_time)
        # The tyre lifts off the ground instead of pulling on it.
        tyre = max(-landing.tyre_stiffness * wheel, 0.0)
        return [
            body_velocity,
            wheel_velocity,
            (strut + lift) / landing.sprung_mass - landing.gravity,
            (tyre - strut) / landing.unsprung_mass - landing.gravity,
        ]

    # In flight the gas force and the weight of the wheel hold the strut against its stop.
    hanging = (landing.gas_force + landing.unsprung_mass * landing.gravity) / (
        landing.stop_stiffness + stiffness(spring, 0.0)
    )
    # The wheel touches the ground at t = 0.
    start = [hanging, 0.0, -landing.velocity, -landing.velocity]
    span = (float(instants[0]), float(instants[-1]))
    # The stop and the tyre make the forces non-smooth; the step limit keeps them from being missed.
    solution = solve_ivp(
        derivative, span, start, "DOP853", instants, rtol=1e-9, atol=1e-11, max_step=span[1] / 100.0
    )
    body, wheel, body_velocity, wheel_velocity = solution.y
    travel = wheel - body
    forces = [
        strut_force(x, v)
        for x, v in zip(travel.tolist(), (wheel_velocity - body_velocity).tolist(), strict=True)
    ]
    return np.array([travel, body_velocity, forces])
