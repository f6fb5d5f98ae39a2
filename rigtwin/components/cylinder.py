"""Hydraulic cylinders under position control: H(s) scaled to unit static gain, sampled exactly for
a held command, then a limit of the speed and a play at the output. MJCF has no actuator of fourth
order, so this runs beside MuJoCo and prescribes the plates' motion."""

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
    """Position-controlled hydraulic cylinder: (b2 s² + b1 s + b0) / (s⁴ + a3 s³ + a2 s² + a1 s +
    a0), scaled to unit static gain, then a limit of the speed, a play between piston and plate, and
    a plate that yields by compliance·(load − `zero_load`), `yield_lag` behind it."""

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
    gain: loop.Gain = loop.NOMINAL.gain
    lag: loop.Lag = loop.NOMINAL.lag
    delay: loop.Delay = loop.NOMINAL.delay
    deadband: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-4, UNLIMITED, NONE)] = UNLIMITED
    compliance: Annotated[
        float, Quantity("m/N", 0.0, 2e-5, "0: a cylinder in position control does not yield, §3.2")
    ] = 0.0
    yield_lag: Annotated[float, Quantity("s", 0.0, 0.1, "0: yields at once; assumed")] = 0.0
    zero_load: Annotated[
        float, Quantity("N", -2000.0, 2000.0, "0: the plate was set to zero without load; assumed")
    ] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0


class CylinderModel(NamedTuple):
    """Sampled cylinder: z⁺ = transition·z + entry·command; y⁺ = ahead·z + direct·command; the
    piston follows y⁺ by at most `step` metres, the plate stays within ±`slack` of the piston.
    Shapes (4, 4), (4,), (4,), scalars."""

    transition: Array
    entry: Array
    ahead: Array
    direct: float
    step: float
    slack: float


class CylinderState(NamedTuple):
    """filter: states z of H(s), shape (4,); position: of the plate and of the piston in m, shape
    (2,). Changed in place."""

    filter: Array
    position: Array


def closed_loop(cylinder: Cylinder) -> loop.ClosedLoop:
    """What of it a controller can be told: H(s), gain, lag and delay."""
    return loop.ClosedLoop(*(getattr(cylinder, name) for name in loop.ClosedLoop._fields))


def told_settings(cylinder: Cylinder, before: float = 0.0) -> dict[str, float]:
    """What of it a controller can be told, as settings of one that compensates its delay. before:
    s of delay between the controller and the cylinder, such as the computer's."""
    found = closed_loop(cylinder)
    late = min(found.delay + before, loop.LATE.high)
    return {f"plate_{name}": value for name, value in found._replace(delay=late)._asdict().items()}


@lru_cache(maxsize=64)
def discretise(cylinder: Cylinder, timestep: float) -> CylinderModel:
    """The cylinder sampled at `timestep` (s) with its command held; not to be changed.

    Kept, because scipy's linear algebra leaves threads spinning for a while, which would slow down
    rigs that run beside.
    """
    a, b, c = loop.state_space(closed_loop(cylinder))
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
    """At rest at `position` (m) under a command of that value."""
    return CylinderState(
        np.array([position / cylinder.a0, 0.0, 0.0, 0.0]), np.array([position, position])
    )


@compilable
def next_piston(model: CylinderModel, state: CylinderState, command: float) -> float:
    """The piston's position one timestep ahead, m; changes nothing."""
    wanted = model.direct * command
    for i in range(4):
        wanted += model.ahead[i] * state.filter[i]
    here = state.position[1]
    return here + min(max(wanted - here, -model.step), model.step)


@compilable
def follow(model: CylinderModel, state: CylinderState, piston: float) -> float:
    """Where the plate is once the piston is there, m: with it but for the play."""
    return min(max(state.position[0], piston - model.slack), piston + model.slack)


@compilable
def next_position(model: CylinderModel, state: CylinderState, command: float) -> float:
    """Plate position one timestep ahead, m; changes nothing."""
    return follow(model, state, next_piston(model, state, command))


@compilable
def advance_cylinder(model: CylinderModel, state: CylinderState, command: float) -> None:
    """One timestep, in place."""
    piston = next_piston(model, state, command)
    state.position[0], state.position[1] = follow(model, state, piston), piston
    z0, z1, z2, z3 = state.filter[0], state.filter[1], state.filter[2], state.filter[3]
    for i in range(4):
        row = model.transition[i]
        state.filter[i] = (
            row[0] * z0 + row[1] * z1 + row[2] * z2 + row[3] * z3 + model.entry[i] * command
        )
