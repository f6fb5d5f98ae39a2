"""Component replays: recorded signals drive one component alone, and its output is put beside what
was measured.

All mechanics run in the twin's own model; a replay only prescribes more of its joints or forces
than a test does.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

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
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import forward, integrate, kernel
from rigtwin.simulation.mechanics import Handles, build, handles
from rigtwin.simulation.plant import (
    Contacts,
    brace,
    contacts,
    drive,
    initial_deflection,
    motor_force,
    touch,
    true_measurements,
)

FIXED = 1e6
"""kg; a carriage this heavy goes where it is driven."""
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


@kernel
def _mechanics(
    mechanics: Handles,
    contacts: Contacts,
    motor_drive: Actuator,
    motor_command: ActuatorState,
    substeps: int,
    ground: Array,
    structure: Array,
    carriage: Array,
    voltage: Array,
    force: Array,
    load_cell_out: Array,
    wheel_out: Array,
) -> None:
    """Motions have substeps·(ticks − 1) + 2 samples. An empty carriage array leaves the carriage
    free."""
    driven = len(carriage) > 0
    ticks = len(voltage)
    for tick in range(ticks):
        following = force[min(tick + 1, ticks - 1)]
        for substep in range(substeps):
            now = tick * substeps + substep
            mechanics.control[0] = condition(motor_drive, motor_command, voltage[tick])
            drive(mechanics, mechanics.ground, ground[now], ground[now + 1])
            drive(mechanics, mechanics.structure, structure[now], structure[now + 1])
            if driven:
                drive(mechanics, mechanics.carriage, carriage[now], carriage[now + 1])
            mechanics.applied[mechanics.carriage] = 0.0
            touch(mechanics, contacts)
            if driven:
                mechanics.applied[mechanics.carriage] = motor_force(mechanics)
            else:
                share = substep / substeps
                load = (1.0 - share) * force[tick] + share * following
                mechanics.applied[mechanics.carriage] -= load
            brace(mechanics)
            forward(mechanics.model, mechanics.data, 0, 1 if substep else 0)
            if substep == 0:
                true = true_measurements(mechanics)
                load_cell_out[tick] = true.load_cell
                wheel_out[tick] = true.structure_lvdt - true.suspension_lvdt
                if tick == ticks - 1:
                    return
            integrate(mechanics.model, mechanics.data)


def _interpolate(motion: Array, substeps: int) -> Array:
    """A motion sampled at ticks, at every substep and one beyond, by a cubic spline: its velocity
    must not jump, or a motor that sticks would have to pass on the blow."""
    ticks = len(motion)
    spline = CubicSpline(np.arange(ticks), motion)
    fine = spline(np.arange(substeps * (ticks - 1) + 1) / substeps)
    return np.append(fine, 2 * fine[-1] - fine[-2])


def _run(
    plant: RigPlant,
    configuration: Configuration,
    ground: Array,
    structure: Array,
    carriage: Array | None,
    voltage: Array,
    force: Array,
    preload: float,
    wheel: float,
) -> Output:
    """preload: motor force at the start, N; wheel: carriage position at the start, m."""
    model = build(plant, configuration.timing.timestep)
    data = mujoco.MjData(model)
    view = handles(model, data)
    view.qpos[view.carriage] = wheel
    view.activation[0] = preload / view.motor_constant
    substeps = configuration.substeps
    conditioning = actuator(plant.motor, plant.computer, configuration.timing.timestep)
    out = Output(np.empty(len(voltage)), np.empty(len(voltage)))
    _mechanics(
        mechanics=view,
        contacts=contacts(plant, wheel, float(structure[0]) - wheel, preload),
        motor_drive=conditioning,
        motor_command=hold(conditioning, preload / plant.motor.constant),
        substeps=substeps,
        ground=_interpolate(ground, substeps),
        structure=_interpolate(structure, substeps),
        carriage=np.empty(0) if carriage is None else _interpolate(carriage, substeps),
        voltage=np.ascontiguousarray(voltage),
        force=np.ascontiguousarray(force),
        load_cell_out=out.load_cell,
        wheel_out=out.wheel,
    )
    return out


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
        carriage=None,
        voltage=nothing,
        force=force,
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
        carriage=None,
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
        carriage=nothing,
        voltage=voltage,
        force=nothing,
        preload=preload,
        wheel=0.0,
    ).load_cell
