"""One step of the carriage between its plates: one scalar inclusion, solved exactly.

With the velocity v after a step of length h implicit, and set-valued friction F_rail and F_dry:

    m·(v − v₀)/h + d_rail·v + F_rail(v) ∋ F_tyre − F_motor + d_motor·(z_s' − v) + F_dry(z_s' − v)

The inclusion is piecewise linear and monotonic in v, so its solution is found case by case, without
iteration or regularised friction (Moreau's time stepping; Acary and Brogliato, Numerical Methods
for Nonsmooth Dynamical Systems, 2008).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.compiled import compilable
from rigtwin.components import RigPlant
from rigtwin.components.dry_friction import breakaway
from rigtwin.components.yielding import Rod, share_of_load, solve_yielding
from rigtwin.numerics.compiling import part_kernel
from rigtwin.simulation.plant_forces import stiffness_ratio
from rigtwin.simulation.rig_contacts import RigContacts


class CarriageConstants(NamedTuple):
    """Constants of the carriage's equation of motion, except those of its contacts.

    What a step would have to divide for is divided here: a division costs as much as all else of
    the step.
    """

    timestep: float  # Integration step, s.
    rate: float  # Steps per second, 1/s.
    mass: float  # Mass of the carriage, kg.
    rail_viscous: float  # Viscous friction of the rail, Ns/m.
    motor_viscous: float  # Viscous friction between motor and carriage, Ns/m.
    motor_constant: float  # Force per unit of voltage, N/V.
    motor_share: float  # Share of a force step that the motor covers in a timestep.
    voltage_limit: float  # Largest voltage of the amplifier, V.
    shares: tuple[float, float]  # Yielding of ground and structure plate per load, m/(Ns).
    fades: tuple[float, float]  # Rates at which the plates lose their yield, 1/s.


def arrange_carriage(plant: RigPlant, timestep: float) -> CarriageConstants:
    """Return the constants of the carriage's equation of motion."""
    motor, cylinders = plant.motor, (plant.ground_cylinder, plant.structure_cylinder)
    ground, structure = (
        share_of_load(cylinder.compliance, cylinder.yield_lag, timestep) for cylinder in cylinders
    )
    return CarriageConstants(
        timestep=timestep,
        rate=1.0 / timestep,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=motor.viscous,
        motor_constant=motor.constant,
        # Exact solution of the amplifier's first-order lag over a step.
        motor_share=1.0 - math.exp(-timestep / motor.time_constant),
        voltage_limit=min(motor.voltage_limit, motor.force_limit / motor.constant),
        shares=(ground, structure),
        fades=(
            1.0 / (cylinders[0].yield_lag + timestep),
            1.0 / (cylinders[1].yield_lag + timestep),
        ),
    )


@compilable
def solve_velocity(
    rhs: float, inertia: float, rail: tuple[float, float], motor: tuple[float, float], plate: float
) -> float:
    """Solve inertia·v + rail friction(v) − motor friction(plate − v) ∋ rhs for the velocity v.

    Parameters
    ----------
    rhs
        Momentum without dry friction, Ns.
    inertia
        Inertia with implicit damping, kg.
    rail
        Limits of the rail's friction impulse against positive and negative v, Ns.
    motor
        Limits of the motor's friction impulse against positive and negative plate − v, Ns.
    plate
        Velocity of the plate, m/s.

    Returns
    -------
    float
        Velocity, m/s.
    """
    # The left side grows with v and jumps at v = 0 (rail sticks) and v = plate (motor sticks).
    # Try the three ranges between the jumps; clipping the middle one covers both sticking cases.
    below = (rhs + rail[1] + motor[0]) / inertia
    if below < min(0.0, plate):
        return below
    above = (rhs - rail[0] - motor[1]) / inertia
    if above > max(0.0, plate):
        return above
    between = (
        (rhs - rail[0] + motor[0]) / inertia
        if plate > 0.0
        else (rhs + rail[1] - motor[1]) / inertia
    )
    return min(max(between, min(0.0, plate)), max(0.0, plate))


@compilable
def motor_friction(
    rhs: float,
    inertia: float,
    rail: tuple[float, float],
    motor: tuple[float, float],
    plate: float,
    velocity: float,
) -> float:
    """Return the motor's dry friction at the solution of `solve_velocity`.

    Parameters
    ----------
    rhs, inertia, rail, motor, plate
        Arguments of `solve_velocity`.
    velocity
        Solution of `solve_velocity`, m/s.

    Returns
    -------
    float
        Friction impulse on the carriage, Ns.
    """
    if velocity < plate:
        return motor[0]
    if velocity > plate:
        return -motor[1]
    unbalanced = inertia * velocity - rhs
    if velocity > 0.0:
        unbalanced += rail[0]
    elif velocity < 0.0:
        unbalanced -= rail[1]
    else:
        # Both contacts stick, and their shares are not unique. The rail takes as much as it can, as
        # at the start of a test before anything has moved.
        unbalanced += min(max(-unbalanced, -rail[1]), rail[0])
    return min(max(unbalanced, -motor[1]), motor[0])


@part_kernel
def friction_limits(
    now: RigContacts, x: float, v: float, travel: float, sliding: float, load: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the limits of the rail's and the motor's dry friction, N.

    Each pair holds against positive and negative motion: of the carriage (x, v), and of the
    structure plate relative to it (travel, sliding).
    """
    if not now.changing:
        rail, motor = now.rail.coulomb, now.motor.coulomb
        return (rail, rail), (motor, motor)
    rail_limits = breakaway(now.rail, now.rail_gap, x, v, load)
    return rail_limits, breakaway(now.motor, now.motor_gap, travel, sliding, load)


@part_kernel
def press_tyre(
    now: RigContacts, deflection: float, ground_loss: float, share: float, h: float
) -> tuple[float, float]:
    """Return spring force, N, and damping, Ns/m, of the tyre: F = spring + damping·(z_g' − v).

    The tyre's F = k·δ + d·(z_g' − v) is implicit in v. A ground plate that yields by `share`·F
    takes a part of the deflection, which divides the force by `loading`.
    """
    if not deflection > 0.0:
        return 0.0, 0.0
    ratio = stiffness_ratio(now, deflection)
    loading = 1.0 + share * (h * now.stiffness * ratio + now.damping)
    spring = now.stiffness * (deflection + h * ground_loss) * ratio / loading
    return spring, now.damping / loading


class CarriageForces(NamedTuple):
    """Forces on the carriage over one step, and velocities of the plates."""

    momentum: float  # Momentum before the step, Ns.
    motor: float  # Motor force without cogging and friction, N.
    cogging: float  # Cogging of the motor, N.
    gas: float  # Force of the gas spring, N.
    pushed: float  # Unmodelled force, N.
    rail: tuple[float, float]  # Limits of the rail's dry friction, N.
    rod: tuple[float, float]  # Limits of the motor's dry friction, N.
    spring: float  # Spring force of the tyre, N.
    damping: float  # Damping of the tyre, Ns/m.
    ground: float  # Velocity of the ground plate without load, m/s.
    structure: float  # Velocity of the structure plate without load and yielding, m/s.
    loss: float  # Velocity at which the structure plate loses its yield, m/s.


@part_kernel
def solve_step(
    carriage: CarriageConstants, forces: CarriageForces, yields: bool
) -> tuple[float, float, float]:
    """Solve one step for the carriage's velocity, m/s, the load cell's and the tyre's force, N.

    `yields` tells whether the structure plate yields to its load. The motor's force and friction
    act on the carriage through the load cell; a gas spring beside it does not.
    """
    h, force, bias, gas = carriage.timestep, forces.motor, forces.cogging, forces.gas
    plate, spring, damping = forces.structure, forces.spring, forces.damping
    # Limits of friction as impulses over the step, Ns, as the inclusion is one of momentum.
    rail = h * forces.rail[0], h * forces.rail[1]
    motor = h * forces.rod[0], h * forces.rod[1]
    inertia = carriage.mass + h * (carriage.rail_viscous + carriage.motor_viscous)
    free = forces.momentum + h * (
        carriage.motor_viscous * plate - force - bias - gas + forces.pushed
    )
    velocity = cell = tyre = 0.0
    # A tyre does not pull: where it would, the step is solved again without contact.
    for _ in range(2):
        push, resisted = h * (spring + damping * forces.ground), h * damping
        if yields:
            velocity, cell = solve_yielding(
                rod=Rod(
                    free=plate + forces.loss,
                    share=carriage.shares[1],
                    force=force + bias,
                    viscous=carriage.motor_viscous,
                    forward=forces.rod[0],
                    backward=forces.rod[1],
                ),
                rhs=forces.momentum + h * (forces.pushed - gas) + push,
                inertia=carriage.mass + h * carriage.rail_viscous + resisted,
                timestep=h,
                rail=rail,
            )
        else:
            rhs, total = free + push, inertia + resisted
            velocity = solve_velocity(rhs, total, rail, motor, plate)
            dry = motor_friction(rhs, total, rail, motor, plate, velocity) * carriage.rate
            cell = force + bias - dry - carriage.motor_viscous * (plate - velocity)
        tyre = spring + damping * (forces.ground - velocity)
        if tyre >= 0.0:
            break
        spring = damping = 0.0
    return velocity, cell, tyre
