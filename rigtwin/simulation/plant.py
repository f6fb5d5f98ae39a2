"""Running plant of the suspension rig: MuJoCo's mechanics and both cylinders, in compiled code.

The cylinders prescribe the plates' motion; MuJoCo integrates the carriage between them. What
depends on the motion (breakaway, cogging, hardening of the tyre) is written into MuJoCo's model
before each timestep.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components import GasSpring, RigPlant
from rigtwin.components.conditioning import Actuator, ActuatorState, actuator, condition, hold
from rigtwin.components.cylinder import (
    CylinderModel,
    CylinderState,
    advance_cylinder,
    discretise,
    next_position,
    rest_state,
)
from rigtwin.components.dry_friction import Friction, breakaway, friction, gap_at
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.tyre import SCALE
from rigtwin.components.yielding import Rod, share_of_load, solve_yielding
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import forward, integrate
from rigtwin.simulation.mechanics import Handles, build, handles


class RigContacts(NamedTuple):
    """Forces of the mechanics that change with the motion, and their states."""

    changing: bool  # Whether anything but constant friction and a linear tyre acts.
    rail: Friction  # Dry friction of the rail.
    rail_gap: Array  # State of the rail's backlash, m, shape (1,).
    motor: Friction  # Dry friction of the motor.
    motor_gap: Array  # State of the motor's backlash, m, shape (1,).
    cogging: float  # Amplitude of the motor's cogging, N.
    cogging_pitch: float  # Wavelength of the cogging, m.
    cogging_phase: float  # Phase of the cogging at zero travel, rad.
    stiffness: float  # Stiffness of the tyre at small deflection, N/m.
    damping: float  # Damping of the tyre, Ns/m.
    hardening: float  # Hardening of the tyre, 1/m.
    hardening_power: float  # Power of the hardening.
    ground_compliance: float  # Compliance of the ground cylinder, m/N.
    ground_unloaded: float  # Yield of the ground plate without load, m.
    ground_lag: float  # Lag of the ground plate's yielding, s.
    structure_compliance: float  # Compliance of the structure cylinder, m/N.
    structure_unloaded: float  # Yield of the structure plate without load, m.
    structure_lag: float  # Lag of the structure plate's yielding, s.
    mass: float  # Mass of the carriage, kg.
    rail_viscous: float  # Viscous friction of the rail, Ns/m.
    motor_viscous: float  # Viscous friction of the motor, Ns/m.
    gas: GasSpring  # Gas spring parallel to the motor.
    yielded: Array  # Yield of ground and structure plate, m, shape (2,).


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


def contacts(plant: RigPlant, carriage: float, travel: float, preload: float) -> RigContacts:
    """Return a plant's contacts before anything moves.

    Parameters
    ----------
    plant
        Parameters of the rig.
    carriage, travel
        Position of the carriage and travel of the suspension, m.
    preload
        Motor force at the start, N.

    Returns
    -------
    Contacts
        Contacts with new states.
    """
    rail, motor, tyre = friction(plant.rail), friction(plant.motor), plant.tyre
    compliances = plant.ground_cylinder.compliance, plant.structure_cylinder.compliance
    unloaded = unloaded_yield(plant)
    forces = (tyre.hardening, plant.motor.cogging, *compliances, plant.gas_spring.force)
    return RigContacts(
        changing=rail.changing or motor.changing or any(forces),
        rail=rail,
        rail_gap=gap_at(carriage),
        motor=motor,
        motor_gap=gap_at(travel),
        cogging=plant.motor.cogging,
        cogging_pitch=plant.motor.cogging_pitch,
        cogging_phase=plant.motor.cogging_phase,
        stiffness=tyre.stiffness,
        damping=tyre.damping,
        hardening=tyre.hardening,
        hardening_power=tyre.hardening_power,
        ground_compliance=compliances[0],
        ground_unloaded=unloaded[0],
        ground_lag=plant.ground_cylinder.yield_lag,
        structure_compliance=compliances[1],
        structure_unloaded=unloaded[1],
        structure_lag=plant.structure_cylinder.yield_lag,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=plant.motor.viscous,
        gas=plant.gas_spring,
        yielded=np.array(initial_yield(plant, preload)),
    )


def initial_deflection(plant: RigPlant, preload: float) -> float:
    """Return the tyre's deflection at the start, m.

    The tyre carries the motor's preload, N, and the force of the extended gas spring.
    """
    return (preload + plant.gas_spring.force) / plant.tyre.stiffness


def initial_yield(plant: RigPlant, preload: float) -> tuple[float, float]:
    """Return the yield of ground and structure plate at the start, m, under a preload, N."""
    tyre, unloaded = preload + plant.gas_spring.force, unloaded_yield(plant)
    return (
        unloaded[0] - plant.ground_cylinder.compliance * tyre,
        unloaded[1] + plant.structure_cylinder.compliance * preload,
    )


def unloaded_yield(plant: RigPlant) -> tuple[float, float]:
    """Return the yield of ground and structure plate without load, m."""
    ground, structure = plant.ground_cylinder, plant.structure_cylinder
    return ground.compliance * ground.zero_load, -structure.compliance * structure.zero_load


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
        ground_position = float(held[0].memory[3])
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
def drive(mechanics: Handles, joint: int, position: float, position_ahead: float) -> None:
    """Prescribe a joint's motion over the coming timestep, from `position` to the one ahead, m."""
    mechanics.qpos[joint] = position
    mechanics.qvel[joint] = (position_ahead - position) / mechanics.timestep


@compilable
def motor_force(mechanics: Handles) -> float:
    """Return the motor's force without its friction, N."""
    return mechanics.motor_constant * mechanics.activation[0] + mechanics.motor_bias[0]


@compilable
def brace(mechanics: Handles) -> None:
    """Hold the structure plate against the motor's force, as its cylinder does."""
    # Otherwise the motor's dry friction would have to bear a part of that force.
    mechanics.applied[mechanics.structure] = -motor_force(mechanics)


@compilable
def stiffness_ratio(now: RigContacts, deflection: float) -> float:
    """Return the tyre's secant stiffness at a deflection, m, as a factor on the nominal one."""
    if now.hardening == 0.0 or deflection <= 0.0:
        return 1.0
    return max(
        1.0 + now.hardening * deflection * (deflection / SCALE) ** (now.hardening_power - 1.0), 0.0
    )


@compilable
def cogging_force(now: RigContacts, travel: float) -> float:
    """Return the motor's cogging at a travel of the suspension, m: N."""
    if now.cogging == 0.0:
        return 0.0
    return now.cogging * math.sin(2.0 * math.pi * travel / now.cogging_pitch + now.cogging_phase)


@compilable
def touch(mechanics: Handles, now: RigContacts) -> None:
    """Write dry friction, cogging and tyre stiffness of the current motion into the mechanics."""
    if not now.changing:
        return
    carriage, velocity = mechanics.qpos[mechanics.carriage], mechanics.qvel[mechanics.carriage]
    travel = mechanics.qpos[mechanics.structure] - carriage
    sliding = mechanics.qvel[mechanics.structure] - velocity
    load = mechanics.motor_constant * mechanics.activation[0]
    # MuJoCo's dry friction is symmetric: the mean of both directions goes there, and half their
    # difference is an applied force.
    forward, backward = breakaway(now.rail, now.rail_gap, carriage, velocity, load)
    mechanics.rail_friction[0] = 0.5 * (forward + backward)
    mechanics.applied[mechanics.carriage] = 0.5 * (backward - forward)
    if now.gas.force > 0.0:
        mechanics.applied[mechanics.carriage] -= spring_force(now.gas, -travel)
    forward, backward = breakaway(now.motor, now.motor_gap, travel, sliding, load)
    mechanics.motor_friction[0] = 0.5 * (forward + backward)
    mechanics.motor_bias[0] = cogging_force(now, travel) + 0.5 * (backward - forward)
    deflection = max(mechanics.qpos[mechanics.ground] - carriage, 0.0)
    mechanics.tyre[0] = -mechanics.tyre_scale * now.stiffness * stiffness_ratio(now, deflection)


@compilable
def give_way(
    mechanics: Handles, now: RigContacts, ground: float, structure: float
) -> tuple[float, float]:
    """Return the yield of ground and structure plate one timestep ahead, m.

    MuJoCo takes the plates' motion as prescribed, so their loads are predicted here.

    Parameters
    ----------
    mechanics
        State before the timestep.
    now
        Contacts before the timestep; `yielded` is not changed.
    ground, structure
        Velocities of the plates without load, m/s.

    Returns
    -------
    tuple
        Yield of the ground plate and of the structure plate, m.
    """
    h = mechanics.timestep
    v = mechanics.qvel[mechanics.carriage]
    place = mechanics.qpos[mechanics.carriage]
    load, inertia, tyre = motor_force(mechanics), now.mass + h * now.rail_viscous, 0.0
    deflection = mechanics.qpos[mechanics.ground] - place
    share = share_of_load(now.ground_compliance, now.ground_lag, h)
    unloaded = ground + (now.ground_unloaded - now.yielded[0]) / (now.ground_lag + h)
    if deflection > 0.0:
        slope = now.stiffness * stiffness_ratio(now, deflection)
        tyre = slope * (deflection + h * (unloaded - ground)) + now.damping * (unloaded - v)
        tyre = max(tyre / (1.0 + share * (slope * h + now.damping)), 0.0)
    ground_ahead = now.yielded[0] + h * (unloaded - ground - share * tyre)
    if now.structure_compliance == 0.0:
        return ground_ahead, 0.0
    share = share_of_load(now.structure_compliance, now.structure_lag, h)
    travel = mechanics.qpos[mechanics.structure] - place
    sliding = mechanics.qvel[mechanics.structure] - v
    up, down = breakaway(now.rail, now.rail_gap, place, v, load)
    forward, backward = breakaway(now.motor, now.motor_gap, travel, sliding, load)
    # The motor's force already contains the difference of friction between both directions.
    load -= 0.5 * (backward - forward)
    push = tyre - (spring_force(now.gas, -travel) if now.gas.force > 0.0 else 0.0)
    free = structure + (now.structure_unloaded - now.yielded[1]) / (now.structure_lag + h)
    rod = Rod(free, share, load, now.motor_viscous, forward, backward)
    _, cell = solve_yielding(rod, now.mass * v + h * push, inertia, h, (h * up, h * down))
    return ground_ahead, now.yielded[1] + h * (free - structure + share * cell)


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
        next_position(state.ground, state.ground_state, state.ground_command.memory[3]),
        next_position(state.structure, state.structure_state, state.structure_command.memory[3]),
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
        state.ground_command.memory[3] = ground_command
        state.structure_command.memory[3] = structure_command
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
