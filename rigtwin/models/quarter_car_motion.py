"""How the quarter car moves between its plates: one scalar inclusion a step, solved exactly.

Positions are taken at the steps and velocities midway between them, which makes the scheme second
order.
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
from rigtwin.simulation.plant import Contacts, contacts, stiffness_ratio


class Plate(NamedTuple):
    """A plate's unloaded motion. position: m at every step and one beyond, shape (steps·ticks +
    1,); onward: where the command held before a tick would take it one step later, shape
    (ticks,)."""

    position: Array
    onward: Array


class Carriage(NamedTuple):
    """What the carriage's equation of motion needs besides its contacts."""

    timestep: float
    mass: float
    rail_viscous: float
    motor_viscous: float
    motor_constant: float
    motor_share: float
    voltage_limit: float


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
    for tick in range(len(commands)):
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
) -> Plate:
    """A cylinder under its commands, from rest.

    Parameters
    ----------
    cylinder, computer
        Their parameters.
    commands
        m, shape (ticks,).
    start
        Command that was held before, m.
    at
        Where it rests, m; None: where that command holds it.
    timestep
        s.
    steps
        Of integration a tick.

    Returns
    -------
    Plate
        Its unloaded motion.
    """
    conditioning = actuator(cylinder, computer, timestep)
    held = hold(conditioning, start)
    out = Plate(np.empty(len(commands) * steps + 1), np.empty(len(commands)))
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
    """The velocity v that solves inertia·v + rail friction − motor friction ∋ rhs.

    Parameters
    ----------
    rhs, inertia
        Momentum Ns, and kg.
    rail
        Impulses, Ns, that it can bear against positive and negative v.
    motor
        The same against positive and negative plate − v.
    plate
        The plate's velocity, m/s.

    Returns
    -------
    float
        m/s.
    """
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
    """The dry friction of the motor at that solution.

    Parameters
    ----------
    rhs, inertia, rail, motor, plate
        As `solve_velocity` takes them.
    velocity
        Its solution, m/s.

    Returns
    -------
    float
        Impulse on the carriage, Ns.
    """
    if velocity < plate:
        return motor[0]
    if velocity > plate:
        return -motor[1]
    left = inertia * velocity - rhs
    if velocity > 0.0:
        left += rail[0]
    elif velocity < 0.0:
        left -= rail[1]
    else:
        # Both stick: the rail carries what it can, as at the start of a test before anything has
        # moved.
        left += min(max(-left, -rail[1]), rail[0])
    return min(max(left, -motor[1]), motor[0])


@kernel
def _mechanics(
    carriage: Carriage,
    now: Contacts,
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
    """pushed: a force on the carriage besides, N, shape (ticks,); out: the true sensors' values,
    shape (4, ticks)."""
    h = carriage.timestep
    x, v, force = start, 0.0, preload
    yielding = 0.0
    inertia = carriage.mass + h * (carriage.rail_viscous + carriage.motor_viscous)
    # Out of the loop, or out of their tuple: in it they cost as much as the rest of a step.
    rate, yielded, changing = 1.0 / h, now.yielded, now.changing
    ground_fades, structure_fades = 1.0 / (now.ground_lag + h), 1.0 / (now.structure_lag + h)
    ground_share = share_of_load(now.ground_compliance, now.ground_lag, h)
    structure_share = share_of_load(now.structure_compliance, now.structure_lag, h)
    for tick in range(len(voltage)):
        for step in range(-1, steps):
            # Before the tick's commands act, once as if the old ones went on: that is what the
            # sensors see.
            place = tick * steps + max(step, 0)
            ground_here, structure_here = ground[place], structure[place]
            if step < 0:
                ground_there, structure_there = ground_onward[tick], structure_onward[tick]
            else:
                ground_there, structure_there = ground[place + 1], structure[place + 1]
            plate_velocity = (structure_there - structure_here) * rate
            ground_velocity = (ground_there - ground_here) * rate
            structure_now, ground_now = structure_here + yielded[1], ground_here + yielded[0]
            # How fast the plates would give up what they have yielded, without load.
            ground_loss = (now.ground_unloaded - yielded[0]) * ground_fades
            structure_loss = (now.structure_unloaded - yielded[1]) * structure_fades
            ground_velocity += ground_loss
            travel = structure_now - x
            deflection = ground_now - x
            rail, motor = (
                (h * now.rail.coulomb, h * now.rail.coulomb),
                (h * now.motor.coulomb, h * now.motor.coulomb),
            )
            bias = beside = 0.0
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
            if now.gas.force > 0.0:
                beside = spring_force(now.gas, -travel)
            free = carriage.mass * v + h * (
                carriage.motor_viscous * plate_velocity - force - bias - beside + pushed[tick]
            )
            spring = damping = 0.0
            if deflection > 0.0:
                ratio = stiffness_ratio(now, deflection)
                given = 1.0 + ground_share * (h * now.stiffness * ratio + now.damping)
                spring = now.stiffness * (deflection + h * ground_loss) * ratio / given
                damping = now.damping / given
            while True:
                push, resisted = h * (spring + damping * ground_velocity), h * damping
                if now.structure_compliance > 0.0:
                    velocity, cell = solve_yielding(
                        rhs=carriage.mass * v + h * (pushed[tick] - beside) + push,
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
                # A tyre does not pull.
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
            asked = condition(motor_drive, motor_command, voltage[tick])
            asked = min(max(asked, -carriage.voltage_limit), carriage.voltage_limit)
            force += carriage.motor_share * (carriage.motor_constant * asked - force)
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
    """The plant between plates that move as prescribed, whatever loads them.

    Parameters
    ----------
    plant
        Its parameters; those of its cylinders do not count.
    timestep
        s.
    ground, structure
        m, at every timestep and at one more, shape (timesteps + 1,).
    voltage, pushed
        V, and a force on the carriage besides, N, shape (timesteps,).
    preload
        Motor force at the start, N.
    start
        Carriage position at the start, m.

    Returns
    -------
    array
        What ideal sensors would read, rows as in Measurements, shape (4, timesteps).
    """
    rigid = Cylinder()
    plant = plant._replace(ground_cylinder=rigid, structure_cylinder=rigid)
    return move_carriage(
        plant=plant,
        plates=(Plate(ground, ground[1:]), Plate(structure, structure[1:])),
        voltage=voltage,
        pushed=pushed,
        start=start,
        travel=float(structure[0]) - start,
        preload=preload,
        timestep=timestep,
        steps=1,
    )


def move_carriage(
    plant: RigPlant,
    plates: tuple[Plate, Plate],
    voltage: Array,
    pushed: Array,
    start: float,
    travel: float,
    preload: float,
    timestep: float,
    steps: int,
) -> Array:
    """The carriage between its plates, from rest.

    Parameters
    ----------
    plant
        Its parameters.
    plates
        Ground and structure, as they move unloaded.
    voltage, pushed
        V, and a force on the carriage besides, N, shape (ticks,).
    start, travel
        Of carriage and suspension at the start, m.
    preload
        Motor force at the start, N.
    timestep
        s.
    steps
        Of integration a tick.

    Returns
    -------
    array
        What ideal sensors would read, rows as in Measurements, shape (4, ticks).
    """
    motor: Motor = plant.motor
    carriage = Carriage(
        timestep=timestep,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=motor.viscous,
        motor_constant=motor.constant,
        motor_share=1.0 - math.exp(-timestep / motor.time_constant),
        voltage_limit=min(motor.voltage_limit, motor.force_limit / motor.constant),
    )
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
