"""Forces that the compiled twin adds to those of MuJoCo."""

from __future__ import annotations

import math

from controllers.compiled import compilable
from rigtwin.components.dry_friction import breakaway
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.tyre import SCALE
from rigtwin.components.yielding import Rod, share_of_load, solve_yielding
from rigtwin.simulation.mechanics import Handles
from rigtwin.simulation.rig_contacts import RigContacts


@compilable
def drive(mechanics: Handles, joint: int, position: float, position_ahead: float) -> None:
    """Prescribe a joint's motion over the coming timestep, from `position` to the one ahead, m."""
    mechanics.qpos[joint] = position
    mechanics.qvel[joint] = (position_ahead - position) / mechanics.timestep


@compilable
def motor_force(mechanics: Handles) -> float:
    """Return the motor's force without its friction, N."""
    return mechanics.motor_constant * mechanics.activation[0] + mechanics.motor_bias[0]


@compilable
def brace(mechanics: Handles) -> None:
    """Hold the structure plate against the motor's force, as its cylinder does."""
    # Otherwise the motor's dry friction would have to bear a part of that force.
    mechanics.applied[mechanics.structure] = -motor_force(mechanics)


@compilable
def stiffness_ratio(now: RigContacts, deflection: float) -> float:
    """Return the tyre's secant stiffness at a deflection, m, as a factor on the nominal one."""
    if now.hardening == 0.0 or deflection <= 0.0:
        return 1.0
    return max(
        1.0 + now.hardening * deflection * (deflection / SCALE) ** (now.hardening_power - 1.0), 0.0
    )


@compilable
def cogging_force(now: RigContacts, travel: float) -> float:
    """Return the motor's cogging at a travel of the suspension, m: N."""
    if now.cogging == 0.0:
        return 0.0
    return now.cogging * math.sin(2.0 * math.pi * travel / now.cogging_pitch + now.cogging_phase)


@compilable
def touch(mechanics: Handles, now: RigContacts) -> None:
    """Write dry friction, cogging and tyre stiffness of the current motion into the mechanics."""
    if not now.changing:
        return
    carriage, velocity = mechanics.qpos[mechanics.carriage], mechanics.qvel[mechanics.carriage]
    travel = mechanics.qpos[mechanics.structure] - carriage
    sliding = mechanics.qvel[mechanics.structure] - velocity
    load = mechanics.motor_constant * mechanics.activation[0]
    # MuJoCo's dry friction is symmetric: the mean of both directions goes there, and half their
    # difference is an applied force.
    forward, backward = breakaway(now.rail, now.rail_gap, carriage, velocity, load)
    mechanics.rail_friction[0] = 0.5 * (forward + backward)
    mechanics.applied[mechanics.carriage] = 0.5 * (backward - forward)
    if now.gas.force > 0.0:
        mechanics.applied[mechanics.carriage] -= spring_force(now.gas, -travel)
    forward, backward = breakaway(now.motor, now.motor_gap, travel, sliding, load)
    mechanics.motor_friction[0] = 0.5 * (forward + backward)
    mechanics.motor_bias[0] = cogging_force(now, travel) + 0.5 * (backward - forward)
    deflection = max(mechanics.qpos[mechanics.ground] - carriage, 0.0)
    mechanics.tyre[0] = -mechanics.tyre_scale * now.stiffness * stiffness_ratio(now, deflection)


@compilable
def give_way(
    mechanics: Handles, now: RigContacts, ground: float, structure: float
) -> tuple[float, float]:
    """Return the yield of ground and structure plate one timestep ahead, m.

    MuJoCo takes the plates' motion as prescribed, so their loads are predicted here.

    Parameters
    ----------
    mechanics
        State before the timestep.
    now
        Contacts before the timestep; `yielded` is not changed.
    ground, structure
        Velocities of the plates without load, m/s.

    Returns
    -------
    tuple
        Yield of the ground plate and of the structure plate, m.
    """
    h = mechanics.timestep
    v = mechanics.qvel[mechanics.carriage]
    place = mechanics.qpos[mechanics.carriage]
    load, inertia, tyre = motor_force(mechanics), now.mass + h * now.rail_viscous, 0.0
    deflection = mechanics.qpos[mechanics.ground] - place
    share = share_of_load(now.ground_compliance, now.ground_lag, h)
    unloaded = ground + (now.ground_unloaded - now.yielded[0]) / (now.ground_lag + h)
    if deflection > 0.0:
        slope = now.stiffness * stiffness_ratio(now, deflection)
        tyre = slope * (deflection + h * (unloaded - ground)) + now.damping * (unloaded - v)
        tyre = max(tyre / (1.0 + share * (slope * h + now.damping)), 0.0)
    ground_ahead = now.yielded[0] + h * (unloaded - ground - share * tyre)
    if now.structure_compliance == 0.0:
        return ground_ahead, 0.0
    share = share_of_load(now.structure_compliance, now.structure_lag, h)
    travel = mechanics.qpos[mechanics.structure] - place
    sliding = mechanics.qvel[mechanics.structure] - v
    up, down = breakaway(now.rail, now.rail_gap, place, v, load)
    forward, backward = breakaway(now.motor, now.motor_gap, travel, sliding, load)
    # The motor's force already contains the difference of friction between both directions.
    load -= 0.5 * (backward - forward)
    push = tyre - (spring_force(now.gas, -travel) if now.gas.force > 0.0 else 0.0)
    free = structure + (now.structure_unloaded - now.yielded[1]) / (now.structure_lag + h)
    rod = Rod(free, share, load, now.motor_viscous, forward, backward)
    _, cell = solve_yielding(rod, now.mass * v + h * push, inertia, h, (h * up, h * down))
    return ground_ahead, now.yielded[1] + h * (free - structure + share * cell)
