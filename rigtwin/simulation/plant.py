"""Running plant of the suspension rig: MuJoCo's mechanics and both cylinders, in compiled code.

The cylinders prescribe the plates' motion; MuJoCo integrates the carriage between them. What
depends on the motion (breakaway, cogging, hardening of the tyre) is written into MuJoCo's model
before each timestep.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components import RigPlant
from rigtwin.components.conditioning import Actuator, ActuatorState, actuator, condition, hold
from rigtwin.components.cylinder import (
    CylinderModel,
    CylinderState,
    advance_cylinder,
    discretise,
    next_position,
    rest_state,
)
from rigtwin.components.dry_friction import gap_at
from rigtwin.numerics.compiling import forward, integrate
from rigtwin.simulation.mechanics import Handles, build, handles
from rigtwin.simulation.plant_forces import brace, drive, give_way, touch
from rigtwin.simulation.rig_contacts import RigContacts, contacts, initial_deflection, initial_yield


class PlantState(NamedTuple):
    """One plant as compiled code takes it: its parts and their states."""

    mechanics: Handles
    substeps: int  # Timesteps per tick.
    plain: bool  # Whether commands act unchanged and contacts are constant, as in the nominal rig.
    ground: CylinderModel
    ground_state: CylinderState
    ground_drive: Actuator
    ground_command: ActuatorState
    structure: CylinderModel
    structure_state: CylinderState
    structure_drive: Actuator
    structure_command: ActuatorState
    motor_drive: Actuator
    motor_command: ActuatorState
    contacts: RigContacts


class Simulation:
    """One plant at its start, with the MuJoCo structures that its `state` views.

    The ground plate is at its first command, the suspension uncompressed. Tyre and motor carry the
    preload, and everything is at rest.

    Parameters
    ----------
    plant
        Parameters of the rig.
    timestep
        Integration step, s.
    substeps
        Timesteps per tick.
    ground, structure
        Commands of the cylinders at the start, m.
    preload
        Motor force at the start, N.
    """

    def __init__(
        self,
        plant: RigPlant,
        timestep: float,
        substeps: int,
        ground: float,
        structure: float,
        preload: float,
    ) -> None:
        self.model = build(plant, timestep)
        self.data = mujoco.MjData(self.model)
        view = handles(self.model, self.data)
        drives = [
            actuator(component, plant.computer, timestep)
            for component in (plant.ground_cylinder, plant.structure_cylinder, plant.motor)
        ]
        held = [
            hold(drives[0], ground),
            hold(drives[1], structure),
            hold(drives[2], preload / plant.motor.constant),
        ]
        ground_position = float(held[0].memory[4])
        view.qpos[view.ground] = ground_position
        carriage = (
            ground_position + initial_yield(plant, preload)[0] - initial_deflection(plant, preload)
        )
        view.qpos[view.carriage] = view.qpos[view.structure] = carriage
        view.activation[0] = view.control[0] = preload / plant.motor.constant
        touching = contacts(plant, carriage, 0.0, preload)
        self.state = PlantState(
            mechanics=view,
            substeps=substeps,
            plain=not touching.changing and all(each.neutral for each in drives),
            ground=discretise(plant.ground_cylinder, timestep),
            ground_state=rest_state(plant.ground_cylinder, ground_position),
            ground_drive=drives[0],
            ground_command=held[0],
            structure=discretise(plant.structure_cylinder, timestep),
            structure_state=rest_state(plant.structure_cylinder, carriage),
            structure_drive=drives[1],
            structure_command=held[1],
            motor_drive=drives[2],
            motor_command=held[2],
            contacts=touching,
        )


def continue_motion(before: Simulation, after: Simulation) -> None:
    """Give a plant the motion of another: positions, velocities, forces, states of the cylinders.

    Parameters
    ----------
    before
        Simulation whose motion is copied.
    after
        Simulation that continues it, changed in place.
    """
    # The solver's warm start belongs to the state: without it the next step differs in its last
    # digits.
    old, new = before.data, after.data
    new.qpos[:], new.qvel[:], new.act[:], new.ctrl[:] = old.qpos, old.qvel, old.act, old.ctrl
    new.qacc_warmstart[:] = old.qacc_warmstart
    old_state, new_state = before.state, after.state
    for old, new in (
        (old_state.ground_state, new_state.ground_state),
        (old_state.structure_state, new_state.structure_state),
    ):
        new.filter[:], new.position[:] = old.filter, old.position
    new_state.contacts.yielded[:] = old_state.contacts.yielded
    mechanics = new_state.mechanics
    carriage = mechanics.qpos[mechanics.carriage]
    new_state.contacts.rail_gap[:] = gap_at(carriage)
    new_state.contacts.motor_gap[:] = gap_at(mechanics.qpos[mechanics.structure] - carriage)


@compilable
def true_measurements(mechanics: Handles) -> Measurements:
    """Return the readings of ideal sensors after `forward` with sensors."""
    ground, structure = mechanics.qpos[mechanics.ground], mechanics.qpos[mechanics.structure]
    travel = structure - mechanics.qpos[mechanics.carriage]
    return Measurements(ground, structure, travel, mechanics.sensors[mechanics.load_cell])


@compilable
def sense(state: PlantState) -> Measurements:
    """Return the readings of ideal sensors now, under the commands held until now."""
    # The plates move over the coming timestep as those commands would move them. A sticking motor
    # transmits the force that accelerates the carriage with the plate, which a velocity one
    # timestep old would not show.
    onward = (
        next_position(state.ground, state.ground_state, state.ground_command.memory[4]),
        next_position(state.structure, state.structure_state, state.structure_command.memory[4]),
    )
    move_plates(state, (state.ground_state.position[0], state.structure_state.position[0]), onward)
    forward(state.mechanics.model, state.mechanics.data, 0, 0)
    return true_measurements(state.mechanics)


@compilable
def move_plates(
    state: PlantState, plates: tuple[float, float], plates_ahead: tuple[float, float]
) -> tuple[float, float]:
    """Prescribe the motion of both plates over the coming timestep.

    Parameters
    ----------
    state
        Plant whose mechanics are written.
    plates, plates_ahead
        Unloaded positions of ground and structure plate now and one timestep ahead, m.

    Returns
    -------
    tuple
        Yield of both plates one timestep ahead, m.
    """
    mechanics, now = state.mechanics, state.contacts
    ahead = (0.0, 0.0)
    if now.ground_compliance > 0.0 or now.structure_compliance > 0.0:
        h = mechanics.timestep
        touch(mechanics, now)
        ahead = give_way(
            mechanics, now, (plates_ahead[0] - plates[0]) / h, (plates_ahead[1] - plates[1]) / h
        )
    drive(mechanics, mechanics.ground, plates[0] + now.yielded[0], plates_ahead[0] + ahead[0])
    drive(mechanics, mechanics.structure, plates[1] + now.yielded[1], plates_ahead[1] + ahead[1])
    touch(mechanics, now)
    brace(mechanics)
    return ahead


@compilable
def advance(
    state: PlantState, ground_command: float, structure_command: float, voltage: float
) -> None:
    """Advance the plant by one tick with its commands held: cylinders, m, and motor voltage, V."""
    # The nominal rig needs none of the effects' code.
    if state.plain:
        advance_plain(
            mechanics=state.mechanics,
            substeps=state.substeps,
            ground=state.ground,
            ground_state=state.ground_state,
            structure=state.structure,
            structure_state=state.structure_state,
            ground_command=ground_command,
            structure_command=structure_command,
            voltage=voltage,
        )
        state.ground_command.memory[3:] = ground_command
        state.structure_command.memory[3:] = structure_command
        return
    mechanics, now = state.mechanics, state.contacts
    for _ in range(state.substeps):
        plates = state.ground_state.position[0], state.structure_state.position[0]
        asked = condition(state.ground_drive, state.ground_command, ground_command)
        advance_cylinder(state.ground, state.ground_state, asked)
        asked = condition(state.structure_drive, state.structure_command, structure_command)
        advance_cylinder(state.structure, state.structure_state, asked)
        mechanics.control[0] = condition(state.motor_drive, state.motor_command, voltage)
        plates_ahead = state.ground_state.position[0], state.structure_state.position[0]
        now.yielded[0], now.yielded[1] = move_plates(state, plates, plates_ahead)
        forward(mechanics.model, mechanics.data, 0, 1)
        integrate(mechanics.model, mechanics.data)


@compilable
def advance_plain(
    mechanics: Handles,
    substeps: int,
    ground: CylinderModel,
    ground_state: CylinderState,
    structure: CylinderModel,
    structure_state: CylinderState,
    ground_command: float,
    structure_command: float,
    voltage: float,
) -> None:
    """Advance a plant whose commands act unchanged and whose contacts are constant.

    The result is that of the general way in `advance`, about a third faster.
    """
    mechanics.control[0] = voltage
    for _ in range(substeps):
        ground_here, structure_here = ground_state.position[0], structure_state.position[0]
        advance_cylinder(ground, ground_state, ground_command)
        advance_cylinder(structure, structure_state, structure_command)
        drive(mechanics, mechanics.ground, ground_here, ground_state.position[0])
        drive(mechanics, mechanics.structure, structure_here, structure_state.position[0])
        brace(mechanics)
        forward(mechanics.model, mechanics.data, 0, 1)
        integrate(mechanics.model, mechanics.data)
