"""The running plant: MuJoCo's mechanics and both cylinders, advanced from tick to tick by compiled code."""

from __future__ import annotations

from typing import NamedTuple

import mujoco

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.compiling import forward, integrate
from rigtwin.cylinder import CylinderModel, CylinderState, advance_cylinder, next_position, sampled, settled
from rigtwin.model import Handles, build, handles
from rigtwin.parameters import Plant


class Machine(NamedTuple):
    """All that compiled code needs to run one plant."""

    mechanics: Handles
    substeps: int
    ground: CylinderModel
    ground_state: CylinderState
    structure: CylinderModel
    structure_state: CylinderState


class Simulation:
    """One plant at its start: ground at its first command, spring uncompressed, tyre and motor carrying the preload, all
    at rest. Owns the MuJoCo structures that `machine` looks into."""

    def __init__(self, plant: Plant, timestep: float, substeps: int, ground: float, structure: float, preload: float) -> None:
        """timestep s; ground and structure: plate positions at the start, m; preload: motor force at the start, N."""
        self.model = build(plant, timestep)
        self.data = mujoco.MjData(self.model)
        view = handles(self.model, self.data)
        view.qpos[view.ground] = ground
        view.qpos[view.structure] = structure
        view.qpos[view.carriage] = ground - preload / plant.tyre.stiffness
        view.activation[0] = view.control[0] = preload / plant.motor.constant
        self.machine = Machine(
            view,
            substeps,
            sampled(plant.ground_cylinder, timestep),
            settled(plant.ground_cylinder, ground),
            sampled(plant.structure_cylinder, timestep),
            settled(plant.structure_cylinder, structure),
        )


@compilable
def drive(mechanics: Handles, joint: int, here: float, there: float) -> None:
    """Prescribes a joint's motion over the coming timestep, from `here` to `there` in m."""
    mechanics.qpos[joint] = here
    mechanics.qvel[joint] = (there - here) / mechanics.timestep


@compilable
def brace(mechanics: Handles) -> None:
    """Holds the structure plate against the motor, so that its friction is not asked to."""
    mechanics.applied[mechanics.structure] = -mechanics.motor_constant * mechanics.activation[0]


@compilable
def true_measurements(mechanics: Handles) -> Measurements:
    """What ideal sensors read of the state last computed by `forward` with its sensors."""
    ground, structure = mechanics.qpos[mechanics.ground], mechanics.qpos[mechanics.structure]
    travel = structure - mechanics.qpos[mechanics.carriage]
    return Measurements(ground, structure, travel, mechanics.sensors[mechanics.load_cell])


@compilable
def sense(machine: Machine, ground_command: float, structure_command: float) -> Measurements:
    """Ideal measurements now, under the commands held until now.

    The plates move over the coming timestep as those commands would move them: a motor that sticks passes on the force
    that accelerates the carriage with the plate, which a velocity one timestep old would not show.
    """
    mechanics = machine.mechanics
    ground, structure = machine.ground_state.position[0], machine.structure_state.position[0]
    drive(mechanics, mechanics.ground, ground, next_position(machine.ground, machine.ground_state, ground_command))
    drive(
        mechanics,
        mechanics.structure,
        structure,
        next_position(machine.structure, machine.structure_state, structure_command),
    )
    brace(mechanics)
    forward(mechanics.model, mechanics.data, 0, 0)
    return true_measurements(mechanics)


@compilable
def advance(machine: Machine, ground_command: float, structure_command: float, voltage: float) -> None:
    """One control period with the commands held."""
    mechanics = machine.mechanics
    mechanics.control[0] = voltage
    for _ in range(machine.substeps):
        ground, structure = machine.ground_state.position[0], machine.structure_state.position[0]
        advance_cylinder(machine.ground, machine.ground_state, ground_command)
        advance_cylinder(machine.structure, machine.structure_state, structure_command)
        drive(mechanics, mechanics.ground, ground, machine.ground_state.position[0])
        drive(mechanics, mechanics.structure, structure, machine.structure_state.position[0])
        brace(mechanics)
        forward(mechanics.model, mechanics.data, 0, 1)
        integrate(mechanics.model, mechanics.data)
