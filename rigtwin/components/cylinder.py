"""Hydraulic cylinder under position control, with its plate.

The closed loop H(s) of fourth order is sampled exactly for a held command. A speed limit and a
backlash at the output follow. MuJoCo has no actuator of fourth order, so this law runs beside it
and prescribes the plates' motion.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from scipy.linalg import expm

from controllers import closed_loop as loop
from controllers.compiled import compilable
from rigtwin.components.quantity import NONE, UNLIMITED, Quantity
from rigtwin.numerics.arrays import Array


class Cylinder(NamedTuple):
    """Position-controlled hydraulic cylinder.

    H(s) = (a0/b0)·(b2·s² + b1·s + b0) / (s⁴ + a3·s³ + a2·s² + a1·s + a0), that is with unit static
    gain. Then follow a speed limit of the piston, a backlash between piston and plate, and a plate
    that yields by compliance·(load − zero_load) through a first-order lag `yield_lag`.
    """

    # Coefficients of H(s).
    b2: loop.B2 = loop.NOMINAL.b2
    b1: loop.B1 = loop.NOMINAL.b1
    b0: loop.B0 = loop.NOMINAL.b0
    a3: loop.A3 = loop.NOMINAL.a3
    a2: loop.A2 = loop.NOMINAL.a2
    a1: loop.A1 = loop.NOMINAL.a1
    a0: loop.A0 = loop.NOMINAL.a0
    speed_limit: Annotated[float, Quantity("m/s", 0.001, 10.0, "Vickers cylinder, thesis §3.2")] = (
        0.3
    )
    # Conditioning of the command; neutral in the nominal cylinder.
    gain: loop.Gain = loop.NOMINAL.gain
    lag: loop.Lag = loop.NOMINAL.lag
    delay: loop.Delay = loop.NOMINAL.delay
    deadband: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-4, UNLIMITED, NONE)] = UNLIMITED
    # Yielding of the plate under load (`yielding`), and backlash between piston and plate.
    compliance: Annotated[
        float, Quantity("m/N", 0.0, 2e-5, "0: a cylinder in position control does not yield, §3.2")
    ] = 0.0
    yield_lag: Annotated[float, Quantity("s", 0.0, 0.1, "0: yields at once; assumed")] = 0.0
    zero_load: Annotated[
        float, Quantity("N", -2000.0, 2000.0, "0: the plate was set to zero without load; assumed")
    ] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0


class CylinderModel(NamedTuple):
    """Cylinder sampled at a timestep: z⁺ = transition·z + entry·u, y⁺ = ahead·z + direct·u.

    The piston follows y⁺ by at most `step`, and the plate stays within ±`slack` of the piston.
    """

    transition: Array  # Transition of the filter's states, shape (4, 4).
    entry: Array  # Influence of the held command on the states, shape (4,).
    ahead: Array  # Influence of the states on the output one timestep ahead, shape (4,).
    direct: float  # Influence of the held command on the output one timestep ahead.
    step: float  # Largest motion of the piston in a timestep, m.
    slack: float  # Half the backlash between piston and plate, m.


class CylinderState(NamedTuple):
    """State of a cylinder; changed in place."""

    filter: Array  # States z of H(s), shape (4,).
    position: Array  # Positions of plate and piston, m, shape (2,).


def closed_loop(cylinder: Cylinder) -> loop.ClosedLoop:
    """Return the part of a cylinder that a controller can know: H(s), gain, lag and delay."""
    known = cylinder._asdict()
    return loop.ClosedLoop(*(known[name] for name in loop.ClosedLoop._fields))


def told_settings(cylinder: Cylinder, before: float = 0.0) -> dict[str, float]:
    """Return the cylinder's known dynamics as settings of a delay compensator.

    Parameters
    ----------
    cylinder
        Parameters of the cylinder.
    before
        Delay between the controller and the cylinder, such as the computer's, s.

    Returns
    -------
    dict
        Name of the setting → value.
    """
    known = closed_loop(cylinder)
    late = min(known.delay + before, loop.LATE.high)
    return {f"plate_{name}": value for name, value in known._replace(delay=late)._asdict().items()}


@lru_cache(maxsize=64)
def discretise(cylinder: Cylinder, timestep: float) -> CylinderModel:
    """Return the cylinder sampled at a timestep, s, exactly for a held command.

    The result is cached and must not be changed.
    """
    # Cached, because scipy's linear algebra leaves threads spinning for a while, which slows down
    # rigs that run at the same time.
    a, b, c = loop.state_space(closed_loop(cylinder))
    # The exponential of [[A, b], [0, 0]]·h holds both the transition and the held input's influence
    # (Van Loan, IEEE Transactions on Automatic Control 23(3), 1978).
    both = np.zeros((5, 5))
    both[:4, :4], both[:4, 4] = a, b
    step = expm(both * timestep)
    transition, entry = np.ascontiguousarray(step[:4, :4]), np.ascontiguousarray(step[:4, 4])
    return CylinderModel(
        transition=transition,
        entry=entry,
        ahead=c @ transition,
        direct=float(c @ entry),
        step=cylinder.speed_limit * timestep,
        slack=0.5 * cylinder.backlash,
    )


def rest_state(cylinder: Cylinder, position: float) -> CylinderState:
    """Return the state of rest at a position, m, under a command of the same value."""
    return CylinderState(
        np.array([position / cylinder.a0, 0.0, 0.0, 0.0]), np.array([position, position])
    )


@compilable
def next_piston(model: CylinderModel, state: CylinderState, command: float) -> float:
    """Return the piston's position one timestep ahead, m, without changing the state."""
    wanted = model.direct * command
    for i in range(4):
        wanted += model.ahead[i] * state.filter[i]
    position = state.position[1]
    return position + min(max(wanted - position, -model.step), model.step)


@compilable
def follow(model: CylinderModel, state: CylinderState, piston: float) -> float:
    """Return the plate's position, m, for a piston position: backlash as a play operator."""
    return min(max(state.position[0], piston - model.slack), piston + model.slack)


@compilable
def next_position(model: CylinderModel, state: CylinderState, command: float) -> float:
    """Return the plate's position one timestep ahead, m, without changing the state."""
    return follow(model, state, next_piston(model, state, command))


@compilable
def advance_cylinder(model: CylinderModel, state: CylinderState, command: float) -> None:
    """Advance the cylinder by one timestep, in place."""
    # The output y⁺ is read before the filter advances.
    piston = next_piston(model, state, command)
    state.position[0], state.position[1] = follow(model, state, piston), piston
    z0, z1, z2, z3 = state.filter[0], state.filter[1], state.filter[2], state.filter[3]
    for i in range(4):
        row = model.transition[i]
        state.filter[i] = (
            row[0] * z0 + row[1] * z1 + row[2] * z2 + row[3] * z3 + model.entry[i] * command
        )
