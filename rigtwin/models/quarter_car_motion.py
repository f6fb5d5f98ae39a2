"""Motion of the quarter car between its plates: one scalar inclusion per step, solved exactly.

The carriage (position x, velocity v, mass m) between the ground plate z_g and structure plate z_s:

    m·v' + d_rail·v + F_rail(v) = F_tyre(z_g − x) − F_motor + d_motor·(z_s' − v) + F_dry(z_s' − v)

F_rail and F_dry are set-valued dry friction. A tyre only pushes. `quarter_car_step` solves each
step exactly.

Positions are taken at the steps and velocities midway between them: the scheme is second order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
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
from rigtwin.models.quarter_car_step import (
    CarriageConstants,
    CarriageForces,
    arrange_carriage,
    friction_limits,
    press_tyre,
    solve_step,
)
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel, loop_kernel
from rigtwin.simulation.plant_forces import cogging_force
from rigtwin.simulation.rig_contacts import RigContacts, contacts


class PlateMotion(NamedTuple):
    """Unloaded motion of a plate under its command."""

    position: Array  # Position at every step and one beyond, m, shape (steps·ticks + 1,).
    onward: Array  # Position one step after each tick under the old command, m, shape (ticks,).


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
        # `held.memory[4]` is the last conditioned command, which still acts at this tick.
        onward[tick] = next_position(model, state, held.memory[4])
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
    state = rest_state(cylinder, float(held.memory[4]) if at is None else at)
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
def plate_velocity(plate: PlateMotion, tick: int, place: int, trial: bool, rate: float) -> float:
    """Return the unloaded velocity of a plate over the step from `place`, m/s.

    `trial` asks for the step from a tick under the commands before it; `rate` is 1/step, 1/s.
    """
    ahead = plate.onward[tick] if trial else plate.position[place + 1]
    return (ahead - plate.position[place]) * rate


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
        carriage=arrange_carriage(plant, timestep),
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
