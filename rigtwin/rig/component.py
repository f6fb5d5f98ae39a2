"""Component replays: recorded signals drive one component alone, and its output is put beside what
was measured.

All mechanics are the diagnosis' own model of the quarter car; a replay only prescribes more of its
joints or forces than a test does.
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
from rigtwin.simulation.plant import initial_deflection

FIXED = 1e12
"""kg; a carriage this heavy stays where it is."""
AWAY = 1.0
"""m; a ground plate this far back does not touch the tyre."""


@dataclass(frozen=True)
class Output:
    """What a replay of the mechanics gives at every tick: load cell force N, wheel position m;
    shape (ticks,)."""

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
    for tick in range(len(commands)):
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
    """Command → plate position at every tick, m, unloaded, from rest at `position` under the
    command `start`; by default where that command holds it."""
    out, timestep = np.empty(len(commands)), configuration.timing.timestep
    conditioning = actuator(cylinder, configuration.plant.computer, timestep)
    command = hold(conditioning, start)
    state = rest_state(cylinder, float(command.memory[3]) if position is None else position)
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
    """A motion sampled at ticks, at every substep and one beyond, by a cubic spline: its velocity
    must not jump, or a motor that sticks would have to pass on the blow."""
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
    """force: on the carriage besides, N; preload: motor force at the start, N; wheel: carriage
    position at the start, m."""
    substeps, ticks = configuration.substeps, len(voltage)
    count = substeps * (ticks - 1) + 1
    pushed = np.interp(np.arange(count) / substeps, np.arange(ticks), force)
    _, place, travel, load_cell = follow_plates(
        plant=plant,
        timestep=configuration.timing.timestep,
        ground=_interpolate(ground, substeps),
        structure=_interpolate(structure, substeps),
        voltage=np.repeat(voltage, substeps)[:count],
        pushed=pushed,
        preload=preload,
        start=wheel,
    )[:, ::substeps]
    return Output(load_cell, place - travel)


def replay_carriage(
    configuration: Configuration, ground: Array, force: Array, preload: float
) -> Array:
    """Ground motion and the force of motor and gas spring on the wheel → wheel position, m. Both
    are out of it."""
    plant = configuration.plant
    alone = plant._replace(motor=Motor(coulomb=0.0), gas_spring=GasSpring())
    nothing = np.zeros_like(force)
    wheel = float(ground[0]) - initial_deflection(plant, preload)
    return _run(
        plant=alone,
        configuration=configuration,
        ground=ground,
        structure=nothing,
        voltage=nothing,
        force=-force,
        preload=0.0,
        wheel=wheel,
    ).wheel


def replay_mechanics(
    configuration: Configuration, ground: Array, structure: Array, voltage: Array, preload: float
) -> Output:
    """Both plates' motions and the motor's voltage → load cell force and wheel position: motor and
    carriage together."""
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
    """Travel and voltage → load cell force, N. Friction at standstill is not determined by
    these."""
    alone = configuration.plant._replace(
        carriage=Carriage(FIXED), rail=Rail(coulomb=0.0), gas_spring=GasSpring()
    )
    nothing = np.zeros_like(travel)
    return _run(
        plant=alone,
        configuration=configuration,
        ground=nothing - AWAY,
        structure=travel,
        voltage=voltage,
        force=nothing,
        preload=preload,
        wheel=0.0,
    ).load_cell
