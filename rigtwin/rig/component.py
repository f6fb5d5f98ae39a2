"""Replays of single components: recorded signals drive one component, and its output is predicted.

The mechanics are those of `models.quarter_car_motion`. A replay prescribes more of its motions or
forces than a test does, and takes the other components out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigtwin.components import Carriage, Cylinder, GasSpring, Motor, Rail, RigPlant
from rigtwin.components.conditioning import Actuator, ActuatorState, actuator, condition, hold
from rigtwin.components.cylinder import (
    CylinderModel,
    CylinderState,
    advance_cylinder,
    discretise,
    rest_state,
)
from rigtwin.description.configuration import Configuration
from rigtwin.models.quarter_car_motion import follow_plates
from rigtwin.numerics.arrays import Array, interpolate
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.rig_contacts import initial_deflection

FIXED = 1e12
"""Mass of a carriage that does not move, kg."""
AWAY = 1.0
"""Distance of a ground plate that does not touch the tyre, m."""


@dataclass(frozen=True)
class Output:
    """Output of a replay of the mechanics.

    Attributes
    ----------
    load_cell : Array
        Force at the load cell, N, shape (ticks,).
    wheel : Array
        Position of the wheel, m, shape (ticks,).
    """

    load_cell: Array
    wheel: Array


@kernel
def _cylinder(
    model: CylinderModel,
    state: CylinderState,
    conditioning: Actuator,
    command: ActuatorState,
    commands: Array,
    substeps: int,
    out: Array,
) -> None:
    """Write the plate's position at every tick to `out`, m, shape (ticks,)."""
    for tick in range(len(commands)):
        # The position at a tick is that before its command acts.
        out[tick] = state.position[0]
        for _ in range(substeps):
            advance_cylinder(model, state, condition(conditioning, command, commands[tick]))


def replay_cylinder(
    cylinder: Cylinder,
    configuration: Configuration,
    commands: Array,
    start: float,
    position: float | None = None,
) -> Array:
    """Replay a cylinder: commands → unloaded plate position.

    Parameters
    ----------
    cylinder
        Parameters of the cylinder.
    configuration
        Settings of the test.
    commands
        Commands, m, shape (ticks,).
    start
        Command before the test, m.
    position
        Initial position, m. Default: where the command before the test holds the plate.

    Returns
    -------
    array
        Plate position at every tick, m, shape (ticks,).
    """
    out, timestep = np.empty(len(commands)), configuration.timing.timestep
    conditioning = actuator(cylinder, configuration.plant.computer, timestep)
    command = hold(conditioning, start)
    state = rest_state(cylinder, float(command.memory[4]) if position is None else position)
    model = discretise(cylinder, timestep)
    _cylinder(
        model=model,
        state=state,
        conditioning=conditioning,
        command=command,
        commands=np.ascontiguousarray(commands),
        substeps=configuration.substeps,
        out=out,
    )
    return out


def _interpolate(motion: Array, substeps: int) -> Array:
    """Return a motion sampled at ticks at every substep and one beyond, by a cubic spline."""
    # The velocity must not jump, or a sticking motor would transmit an impact at every tick.
    ticks = len(motion)
    times = np.arange(substeps * (ticks - 1) + 1) / substeps
    fine = interpolate(np.arange(ticks, dtype=float), motion, times)
    return np.append(fine, 2 * fine[-1] - fine[-2])


def _run(
    plant: RigPlant,
    configuration: Configuration,
    ground: Array,
    structure: Array,
    voltage: Array,
    force: Array,
    preload: float,
    wheel: float,
) -> Output:
    """Simulate the mechanics under plate motions, motor voltage and a force on the carriage, N.

    `preload` is the motor force at the start, N, and `wheel` the carriage position there, m.
    """
    substeps, ticks = configuration.substeps, len(voltage)
    count = substeps * (ticks - 1) + 1
    pushed = np.interp(np.arange(count) / substeps, np.arange(ticks), force)
    _, place, travel, load_cell = follow_plates(
        plant=plant,
        timestep=configuration.timing.timestep,
        ground=_interpolate(ground, substeps),
        structure=_interpolate(structure, substeps),
        # A command is held over its tick; a measured motion is interpolated.
        voltage=np.repeat(voltage, substeps)[:count],
        pushed=pushed,
        preload=preload,
        start=wheel,
    )[:, ::substeps]
    return Output(load_cell, place - travel)


def replay_carriage(
    configuration: Configuration, ground: Array, force: Array, preload: float
) -> Array:
    """Replay the carriage: ground motion and suspension force → wheel position.

    Motor and gas spring are taken out; their measured force acts instead.

    Parameters
    ----------
    configuration
        Settings of the test.
    ground
        Motion of the ground plate, m, shape (ticks,).
    force
        Force of motor and gas spring, N, shape (ticks,).
    preload
        Motor force at the start, N.

    Returns
    -------
    array
        Position of the wheel, m, shape (ticks,).
    """
    plant = configuration.plant
    # The measured force contains the motor's friction, so the motor must have none.
    alone = plant._replace(motor=Motor(coulomb=0.0), gas_spring=GasSpring())
    zero = np.zeros_like(force)
    wheel = float(ground[0]) - initial_deflection(plant, preload)
    return _run(
        plant=alone,
        configuration=configuration,
        ground=ground,
        structure=zero,
        voltage=zero,
        force=-force,
        preload=0.0,
        wheel=wheel,
    ).wheel


def replay_mechanics(
    configuration: Configuration, ground: Array, structure: Array, voltage: Array, preload: float
) -> Output:
    """Replay motor and carriage together: plate motions and voltage → force and wheel position.

    Parameters
    ----------
    configuration
        Settings of the test.
    ground, structure
        Motions of the plates, m, shape (ticks,).
    voltage
        Command of the motor, V, shape (ticks,).
    preload
        Motor force at the start, N.

    Returns
    -------
    Output
        Force at the load cell and position of the wheel.
    """
    plant = configuration.plant
    wheel = float(ground[0]) - initial_deflection(plant, preload)
    return _run(
        plant=plant,
        configuration=configuration,
        ground=ground,
        structure=structure,
        voltage=voltage,
        force=np.zeros_like(voltage),
        preload=preload,
        wheel=wheel,
    )


def replay_motor(
    configuration: Configuration, travel: Array, voltage: Array, preload: float
) -> Array:
    """Replay the motor: travel and voltage → force at the load cell.

    These inputs do not determine friction at standstill.

    Parameters
    ----------
    configuration
        Settings of the test.
    travel
        Travel of the suspension, m, shape (ticks,).
    voltage
        Command of the motor, V, shape (ticks,).
    preload
        Motor force at the start, N.

    Returns
    -------
    array
        Force at the load cell, N, shape (ticks,).
    """
    # The carriage is held by its mass and the ground plate is out of reach: the motor is alone.
    alone = configuration.plant._replace(
        carriage=Carriage(FIXED), rail=Rail(coulomb=0.0), gas_spring=GasSpring()
    )
    zero = np.zeros_like(travel)
    return _run(
        plant=alone,
        configuration=configuration,
        ground=zero - AWAY,
        structure=travel,
        voltage=voltage,
        force=zero,
        preload=preload,
        wheel=0.0,
    ).load_cell
