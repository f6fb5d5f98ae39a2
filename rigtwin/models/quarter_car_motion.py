"""Motion of the quarter car between its plates: one scalar inclusion per step, solved exactly.

The carriage (position x, velocity v, mass m) between the ground plate z_g and structure plate z_s:

    m·v' + d_rail·v + F_rail(v) = F_tyre(z_g − x) − F_motor + d_motor·(z_s' − v) + F_dry(z_s' − v)

F_rail and F_dry are set-valued dry friction. A tyre only pushes. With v implicit, each step is a
piecewise linear, monotonic inclusion in v, so its solution is found case by case, without
iteration or regularised friction (Moreau's time stepping; Acary and Brogliato, Numerical Methods
for Nonsmooth Dynamical Systems, 2008).

Positions are taken at the steps and velocities midway between them: the scheme is second order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable, inlined
from rigtwin.components import Computer, Cylinder, RigPlant
from rigtwin.components.conditioning import Actuator, ActuatorState, actuator, condition, hold
from rigtwin.components.cylinder import (
    CylinderModel,
    CylinderState,
    advance_cylinder,
    discretise,
    next_position,
    rest_state,
)
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.guide import breakaway
from rigtwin.components.yielding import Rod, share_of_load, solve_yielding
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel, loop_kernel
from rigtwin.simulation.plant import RigContacts, cogging_force, contacts, stiffness_ratio


class PlateMotion(NamedTuple):
    """Unloaded motion of a plate under its command."""

    position: Array  # Position at every step and one beyond, m, shape (steps·ticks + 1,).
    onward: Array  # Position one step after each tick under the old command, m, shape (ticks,).


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


@kernel
def _plate(
    model: CylinderModel,
    state: CylinderState,
    conditioning: Actuator,
    held: ActuatorState,
    commands: Array,
    steps: int,
    position: Array,
    onward: Array,
) -> None:
    """Move a cylinder by its commands; write `position` and `onward` as in `PlateMotion`."""
    for tick in range(len(commands)):
        # `held.memory[3]` is the last conditioned command, which still acts at this tick.
        onward[tick] = next_position(model, state, held.memory[3])
        for step in range(steps):
            position[tick * steps + step] = state.position[0]
            advance_cylinder(model, state, condition(conditioning, held, commands[tick]))
    position[len(commands) * steps] = state.position[0]


def move_plate(
    cylinder: Cylinder,
    computer: Computer,
    commands: Array,
    start: float,
    at: float | None,
    timestep: float,
    steps: int,
) -> PlateMotion:
    """Move a cylinder by its commands, from rest.

    Parameters
    ----------
    cylinder, computer
        Parameters of the cylinder and of the computer that commands it.
    commands
        Commands, m, shape (ticks,).
    start
        Command before the test, m.
    at
        Initial position, m. Default (None): where the command before the test holds the cylinder.
    timestep
        Integration step, s.
    steps
        Integration steps per tick.

    Returns
    -------
    Plate
        Unloaded motion of the plate.
    """
    conditioning = actuator(cylinder, computer, timestep)
    held = hold(conditioning, start)
    out = PlateMotion(np.empty(len(commands) * steps + 1), np.empty(len(commands)))
    state = rest_state(cylinder, float(held.memory[3]) if at is None else at)
    _plate(
        model=discretise(cylinder, timestep),
        state=state,
        conditioning=conditioning,
        held=held,
        commands=commands,
        steps=steps,
        position=out.position,
        onward=out.onward,
    )
    return out


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


@inlined
def plate_velocity(plate: PlateMotion, tick: int, place: int, trial: bool, rate: float) -> float:
    """Return the unloaded velocity of a plate over the step from `place`, m/s.

    `trial` asks for the step from a tick under the commands before it; `rate` is 1/step, 1/s.
    """
    ahead = plate.onward[tick] if trial else plate.position[place + 1]
    return (ahead - plate.position[place]) * rate


@inlined
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


@inlined
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


@inlined
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


@loop_kernel
def _mechanics(
    carriage: CarriageConstants,
    now: RigContacts,
    drive: tuple[Actuator, ActuatorState],
    start: float,
    preload: float,
    steps: int,
    plates: tuple[PlateMotion, PlateMotion],
    voltage: Array,
    pushed: Array,
    out: Array,
) -> None:
    """Integrate the carriage between its plates.

    `drive` conditions the voltage, V. Arguments are else those of `move_carriage`. The readings of
    ideal sensors are written to `out`, shape (4, ticks).
    """
    (ground, structure), yielded, h = plates, now.yielded, carriage.timestep
    x, v, force, yielding = start, 0.0, preload, 0.0
    for tick in range(len(voltage)):
        for step in range(-1, steps):
            # Step −1 is a trial under the old commands: the sensors read the force before the
            # tick's commands act. It is not integrated.
            place = tick * steps + max(step, 0)
            structure_now = structure.position[place] + yielded[1]
            ground_now = ground.position[place] + yielded[0]
            ground_loss = (now.ground_unloaded - yielded[0]) * carriage.fades[0]
            structure_loss = (now.structure_unloaded - yielded[1]) * carriage.fades[1]
            plate = plate_velocity(structure, tick, place, step < 0, carriage.rate)
            travel, deflection = structure_now - x, ground_now - x
            rail, rod = friction_limits(now, x, v, travel, plate + yielding - v, force)
            spring, damping = press_tyre(now, deflection, ground_loss, carriage.shares[0], h)
            forces = CarriageForces(
                momentum=carriage.mass * v,
                motor=force,
                cogging=cogging_force(now, travel),
                gas=spring_force(now.gas, -travel) if now.gas.force > 0.0 else 0.0,
                pushed=pushed[tick],
                rail=rail,
                rod=rod,
                spring=spring,
                damping=damping,
                ground=plate_velocity(ground, tick, place, step < 0, carriage.rate) + ground_loss,
                structure=plate,
                loss=structure_loss,
            )
            velocity, cell, tyre = solve_step(carriage, forces, now.structure_compliance > 0.0)
            if step < 0:
                out[0, tick], out[1, tick] = ground_now, structure_now
                out[2, tick], out[3, tick] = travel, cell
                continue
            yielding = structure_loss + carriage.shares[1] * cell
            yielded[0] += h * (ground_loss - carriage.shares[0] * tyre)
            yielded[1] += h * yielding
            amplified = condition(drive[0], drive[1], voltage[tick])
            amplified = min(max(amplified, -carriage.voltage_limit), carriage.voltage_limit)
            force += carriage.motor_share * (carriage.motor_constant * amplified - force)
            v = velocity
            x += h * v


def follow_plates(
    plant: RigPlant,
    timestep: float,
    ground: Array,
    structure: Array,
    voltage: Array,
    pushed: Array,
    preload: float,
    start: float,
) -> Array:
    """Simulate the carriage between plates whose motion is prescribed, whatever their load.

    Parameters
    ----------
    plant
        Parameters of the rig. Those of its cylinders are ignored.
    timestep
        Integration step, s.
    ground, structure
        Positions of the plates at every step and one beyond, m, shape (timesteps + 1,).
    voltage
        Voltage of the motor's amplifier, V, shape (timesteps,).
    pushed
        Additional force on the carriage, N, shape (timesteps,).
    preload
        Motor force at the start, N.
    start
        Carriage position at the start, m.

    Returns
    -------
    array
        Readings of ideal sensors, rows as in `Measurements`, shape (4, timesteps).
    """
    rigid = Cylinder()
    plant = plant._replace(ground_cylinder=rigid, structure_cylinder=rigid)
    return move_carriage(
        plant=plant,
        plates=(PlateMotion(ground, ground[1:]), PlateMotion(structure, structure[1:])),
        voltage=voltage,
        pushed=pushed,
        start=start,
        travel=float(structure[0]) - start,
        preload=preload,
        timestep=timestep,
        steps=1,
    )


def _arrange_carriage(plant: RigPlant, timestep: float) -> CarriageConstants:
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


def move_carriage(
    plant: RigPlant,
    plates: tuple[PlateMotion, PlateMotion],
    voltage: Array,
    pushed: Array,
    start: float,
    travel: float,
    preload: float,
    timestep: float,
    steps: int,
) -> Array:
    """Simulate the carriage between its plates, from rest.

    Parameters
    ----------
    plant
        Parameters of the rig.
    plates
        Unloaded motions of the ground plate and the structure plate.
    voltage
        Voltage of the motor's amplifier, V, shape (ticks,).
    pushed
        Additional force on the carriage, N, shape (ticks,).
    start, travel
        Position of the carriage and travel of the suspension at the start, m.
    preload
        Motor force at the start, N.
    timestep
        Integration step, s.
    steps
        Integration steps per tick.

    Returns
    -------
    array
        Readings of ideal sensors, rows as in `Measurements`, shape (4, ticks).
    """
    conditioning = actuator(plant.motor, plant.computer, timestep)
    out = np.empty((4, len(voltage)))
    _mechanics(
        carriage=_arrange_carriage(plant, timestep),
        now=contacts(plant, start, travel, preload),
        drive=(conditioning, hold(conditioning, preload / plant.motor.constant)),
        start=start,
        preload=preload,
        steps=steps,
        plates=plates,
        voltage=np.ascontiguousarray(voltage),
        pushed=np.ascontiguousarray(pushed),
        out=out,
    )
    return out
