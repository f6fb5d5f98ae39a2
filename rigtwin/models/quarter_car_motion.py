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

from controllers.compiled import compilable
from rigtwin.components import Computer, Cylinder, Motor, RigPlant
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
from rigtwin.components.yielding import share_of_load, solve_yielding
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.plant import RigContacts, contacts, stiffness_ratio


class PlateMotion(NamedTuple):
    """Unloaded motion of a plate under its command."""

    position: Array  # Position at every step and one beyond, m, shape (steps·ticks + 1,).
    onward: Array  # Position one step after each tick under the old command, m, shape (ticks,).


class CarriageConstants(NamedTuple):
    """Constants of the carriage's equation of motion, except those of its contacts."""

    timestep: float  # Integration step, s.
    mass: float  # Mass of the carriage, kg.
    rail_viscous: float  # Viscous friction of the rail, Ns/m.
    motor_viscous: float  # Viscous friction between motor and carriage, Ns/m.
    motor_constant: float  # Force per unit of voltage, N/V.
    motor_share: float  # Share of a force step that the motor covers in a timestep.
    voltage_limit: float  # Largest voltage of the amplifier, V.


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


@kernel
def _mechanics(
    carriage: CarriageConstants,
    now: RigContacts,
    motor_drive: Actuator,
    motor_command: ActuatorState,
    start: float,
    preload: float,
    steps: int,
    ground: Array,
    ground_onward: Array,
    structure: Array,
    structure_onward: Array,
    voltage: Array,
    pushed: Array,
    out: Array,
) -> None:
    """Integrate the carriage between its plates.

    Plates, voltage (V) and `pushed`, an unmodelled force on the carriage (N), are those of
    `move_carriage`. The readings of ideal sensors are written to `out`, shape (4, ticks).
    """
    # One kernel on purpose: parts of their own would pass and return two dozen scalars in every
    # step.
    h = carriage.timestep
    x, v, force = start, 0.0, preload
    yielding = 0.0
    inertia = carriage.mass + h * (carriage.rail_viscous + carriage.motor_viscous)
    # Divisions and tuple fields are taken out of the loop: there they double the cost of a step.
    rate, yielded, changing = 1.0 / h, now.yielded, now.changing
    ground_fades, structure_fades = 1.0 / (now.ground_lag + h), 1.0 / (now.structure_lag + h)
    ground_share = share_of_load(now.ground_compliance, now.ground_lag, h)
    structure_share = share_of_load(now.structure_compliance, now.structure_lag, h)
    for tick in range(len(voltage)):
        for step in range(-1, steps):
            # Step −1 is a trial under the old commands: the sensors read the force before the
            # tick's commands act. It is not integrated.
            place = tick * steps + max(step, 0)
            ground_here, structure_here = ground[place], structure[place]
            if step < 0:
                ground_there, structure_there = ground_onward[tick], structure_onward[tick]
            else:
                ground_there, structure_there = ground[place + 1], structure[place + 1]
            plate_velocity = (structure_there - structure_here) * rate
            ground_velocity = (ground_there - ground_here) * rate
            structure_now, ground_now = structure_here + yielded[1], ground_here + yielded[0]
            # Rate at which a yielded plate would return without load, m/s.
            ground_loss = (now.ground_unloaded - yielded[0]) * ground_fades
            structure_loss = (now.structure_unloaded - yielded[1]) * structure_fades
            ground_velocity += ground_loss
            travel = structure_now - x
            deflection = ground_now - x
            rail, motor = (
                (h * now.rail.coulomb, h * now.rail.coulomb),
                (h * now.motor.coulomb, h * now.motor.coulomb),
            )
            bias = gas = 0.0
            forward = backward = now.motor.coulomb
            if changing:
                forward, backward = breakaway(now.rail, now.rail_gap, x, v, force)
                rail = (h * forward, h * backward)
                forward, backward = breakaway(
                    now.motor, now.motor_gap, travel, plate_velocity + yielding - v, force
                )
                motor = (h * forward, h * backward)
                if now.cogging != 0.0:
                    bias = now.cogging * math.sin(
                        2.0 * math.pi * travel / now.cogging_pitch + now.cogging_phase
                    )
            # The motor's force and friction act on the carriage through the load cell, a gas spring
            # beside it does not.
            if now.gas.force > 0.0:
                gas = spring_force(now.gas, -travel)
            free = carriage.mass * v + h * (
                carriage.motor_viscous * plate_velocity - force - bias - gas + pushed[tick]
            )
            spring = damping = 0.0
            if deflection > 0.0:
                # Tyre: F = k·δ + d·(z_g' − v), implicit in v. A ground plate that yields by
                # share·F takes a part of the deflection, which divides the force by `loading`.
                ratio = stiffness_ratio(now, deflection)
                loading = 1.0 + ground_share * (h * now.stiffness * ratio + now.damping)
                spring = now.stiffness * (deflection + h * ground_loss) * ratio / loading
                damping = now.damping / loading
            while True:
                push, resisted = h * (spring + damping * ground_velocity), h * damping
                if now.structure_compliance > 0.0:
                    velocity, cell = solve_yielding(
                        rhs=carriage.mass * v + h * (pushed[tick] - gas) + push,
                        inertia=carriage.mass + h * carriage.rail_viscous + resisted,
                        timestep=h,
                        rail=rail,
                        free=plate_velocity + structure_loss,
                        share=structure_share,
                        force=force + bias,
                        viscous=carriage.motor_viscous,
                        forward=forward,
                        backward=backward,
                    )
                else:
                    rhs, total = free + push, inertia + resisted
                    velocity = solve_velocity(rhs, total, rail, motor, plate_velocity)
                    dry = motor_friction(rhs, total, rail, motor, plate_velocity, velocity) * rate
                    cell = force + bias - dry - carriage.motor_viscous * (plate_velocity - velocity)
                tyre = spring + damping * (ground_velocity - velocity)
                if tyre >= 0.0:
                    break
                # A tyre does not pull: solve again without contact.
                spring = damping = 0.0
            if step < 0:
                out[0, tick], out[1, tick], out[2, tick], out[3, tick] = (
                    ground_now,
                    structure_now,
                    travel,
                    cell,
                )
                continue
            yielding = structure_loss + structure_share * cell
            yielded[0] += h * (ground_loss - ground_share * tyre)
            yielded[1] += h * yielding
            drive_voltage = condition(motor_drive, motor_command, voltage[tick])
            drive_voltage = min(max(drive_voltage, -carriage.voltage_limit), carriage.voltage_limit)
            force += carriage.motor_share * (carriage.motor_constant * drive_voltage - force)
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
    motor: Motor = plant.motor
    return CarriageConstants(
        timestep=timestep,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=motor.viscous,
        motor_constant=motor.constant,
        # Exact solution of the amplifier's first-order lag over a step.
        motor_share=1.0 - math.exp(-timestep / motor.time_constant),
        voltage_limit=min(motor.voltage_limit, motor.force_limit / motor.constant),
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
    motor: Motor = plant.motor
    carriage = _arrange_carriage(plant, timestep)
    out = np.empty((4, len(voltage)))
    ground, structure = plates
    _mechanics(
        carriage=carriage,
        now=contacts(plant, start, travel, preload),
        motor_drive=actuator(motor, plant.computer, timestep),
        motor_command=hold(actuator(motor, plant.computer, timestep), preload / motor.constant),
        start=start,
        preload=preload,
        steps=steps,
        ground=ground.position,
        ground_onward=ground.onward,
        structure=structure.position,
        structure_onward=structure.onward,
        voltage=np.ascontiguousarray(voltage),
        pushed=np.ascontiguousarray(pushed),
        out=out,
    )
    return out
