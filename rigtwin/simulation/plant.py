"""The running plant.

MuJoCo's mechanics and both cylinders, advanced from tick to tick by compiled
code.
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
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.guide import Friction, breakaway, friction, gap_at
from rigtwin.components.tyre import SCALE
from rigtwin.components.yielding import share_of_load, solve_yielding
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import forward, integrate
from rigtwin.simulation.mechanics import Handles, build, handles


class Contacts(NamedTuple):
    """What changes with the motion in the mechanics, and its states.

    gaps: of the backlashes, shape
    (1,) each; yielded: of the ground and structure plate under
    load, m, shape (2,).
    """

    changing: bool
    rail: Friction
    rail_gap: Array
    motor: Friction
    motor_gap: Array
    cogging: float
    cogging_pitch: float
    cogging_phase: float
    stiffness: float
    damping: float
    hardening: float
    hardening_power: float
    ground_compliance: float
    ground_unloaded: float
    ground_lag: float
    structure_compliance: float
    structure_unloaded: float
    structure_lag: float
    mass: float
    rail_viscous: float
    motor_viscous: float
    gas: GasSpring
    yielded: Array


class PlantState(NamedTuple):
    """All that compiled code needs to run one plant: its parts and their states.

    `plain` says whether its commands act as they are
    and its contacts do not change with the
    motion, as in the nominal rig.
    """

    mechanics: Handles
    substeps: int
    plain: bool
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
    contacts: Contacts


def contacts(plant: RigPlant, carriage: float, travel: float, preload: float) -> Contacts:
    """Gives a plant's contacts before anything moves.

    Parameters
    ----------
    plant : RigPlant
        Whose.
    carriage, travel : float
        Where they are, m.
    preload : float
        What the motor pushes with, N.

    Returns
    -------
    Contacts
        With states of their own.
    """
    rail, motor, tyre = friction(plant.rail), friction(plant.motor), plant.tyre
    compliances = plant.ground_cylinder.compliance, plant.structure_cylinder.compliance
    unloaded = unloaded_yield(plant)
    forces = (tyre.hardening, plant.motor.cogging, *compliances, plant.gas_spring.force)
    return Contacts(
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
    """The tyre's deflection at the start, m.

    It carries the motor's preload (N) and the extended
    gas spring.
    """
    return (preload + plant.gas_spring.force) / plant.tyre.stiffness


def initial_yield(plant: RigPlant, preload: float) -> tuple[float, float]:
    """How far ground and structure plate have yielded at the start, m, under a preload in N."""
    tyre, unloaded = preload + plant.gas_spring.force, unloaded_yield(plant)
    return (
        unloaded[0] - plant.ground_cylinder.compliance * tyre,
        unloaded[1] + plant.structure_cylinder.compliance * preload,
    )


def unloaded_yield(plant: RigPlant) -> tuple[float, float]:
    """How far ground and structure plate stand from their zero without load, m."""
    ground, structure = plant.ground_cylinder, plant.structure_cylinder
    return ground.compliance * ground.zero_load, -structure.compliance * structure.zero_load


class Simulation:
    """One plant at its start.

    Ground at its first command, spring uncompressed, tyre and motor
    carrying the preload, all at
    rest. Owns the MuJoCo structures that `state` looks into.
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
        """timestep s.

        Ground and structure: commands at the start, m; preload: motor force at the
        start, N.
        """
        self.model = build(plant, timestep)
        self.data = mujoco.MjData(self.model)
        view = handles(self.model, self.data)
        drives = [
            actuator(of, plant.computer, timestep)
            for of in (plant.ground_cylinder, plant.structure_cylinder, plant.motor)
        ]
        held = [
            hold(drives[0], ground),
            hold(drives[1], structure),
            hold(drives[2], preload / plant.motor.constant),
        ]
        here = float(held[0].memory[3])
        view.qpos[view.ground] = here
        carriage = here + initial_yield(plant, preload)[0] - initial_deflection(plant, preload)
        view.qpos[view.carriage] = view.qpos[view.structure] = carriage
        view.activation[0] = view.control[0] = preload / plant.motor.constant
        touching = contacts(plant, carriage, 0.0, preload)
        self.state = PlantState(
            mechanics=view,
            substeps=substeps,
            plain=not touching.changing and all(each.neutral for each in drives),
            ground=discretise(plant.ground_cylinder, timestep),
            ground_state=rest_state(plant.ground_cylinder, here),
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
    """Puts another plant where one stands: positions, velocities, forces and what the cylinders go
    through.

    Parameters
    ----------
    before : Simulation
        It stays as it is.
    after : Simulation
        Changed in place.
    """
    for name in ("qpos", "qvel", "act", "ctrl", "qacc_warmstart"):
        getattr(after.data, name)[:] = getattr(before.data, name)
    here, there = before.state, after.state
    for old, new in (
        (here.ground_state, there.ground_state),
        (here.structure_state, there.structure_state),
    ):
        new.filter[:], new.position[:] = old.filter, old.position
    there.contacts.yielded[:] = here.contacts.yielded
    mechanics = there.mechanics
    carriage = mechanics.qpos[mechanics.carriage]
    there.contacts.rail_gap[:] = gap_at(carriage)
    there.contacts.motor_gap[:] = gap_at(mechanics.qpos[mechanics.structure] - carriage)


@compilable
def drive(mechanics: Handles, joint: int, here: float, there: float) -> None:
    """Prescribes a joint's motion over the coming timestep, from `here` to `there` in m."""
    mechanics.qpos[joint] = here
    mechanics.qvel[joint] = (there - here) / mechanics.timestep


@compilable
def motor_force(mechanics: Handles) -> float:
    """What the motor pushes with now, its friction apart, N."""
    return mechanics.motor_constant * mechanics.activation[0] + mechanics.motor_bias[0]


@compilable
def brace(mechanics: Handles) -> None:
    """Holds the structure plate against the motor, so that its friction is not asked to."""
    mechanics.applied[mechanics.structure] = -motor_force(mechanics)


@compilable
def stiffness_ratio(now: Contacts, deflection: float) -> float:
    """How many times its nominal secant stiffness the tyre has at a deflection, m."""
    if now.hardening == 0.0 or deflection <= 0.0:
        return 1.0
    return max(
        1.0 + now.hardening * deflection * (deflection / SCALE) ** (now.hardening_power - 1.0), 0.0
    )


@compilable
def touch(mechanics: Handles, now: Contacts) -> None:
    """Writes into the mechanics what depends on the motion.

    Dry friction, cogging, the tyre's
    slope.
    """
    if not now.changing:
        return
    carriage, velocity = mechanics.qpos[mechanics.carriage], mechanics.qvel[mechanics.carriage]
    travel = mechanics.qpos[mechanics.structure] - carriage
    sliding = mechanics.qvel[mechanics.structure] - velocity
    load = mechanics.motor_constant * mechanics.activation[0]
    # MuJoCo's dry friction is the same both ways; what one way has more is a force besides.
    forward, backward = breakaway(now.rail, now.rail_gap, carriage, velocity, load)
    mechanics.rail_friction[0] = 0.5 * (forward + backward)
    mechanics.applied[mechanics.carriage] = 0.5 * (backward - forward)
    if now.gas.force > 0.0:
        mechanics.applied[mechanics.carriage] -= spring_force(now.gas, -travel)
    forward, backward = breakaway(now.motor, now.motor_gap, travel, sliding, load)
    mechanics.motor_friction[0] = 0.5 * (forward + backward)
    cogging = now.cogging * math.sin(2.0 * math.pi * travel / now.cogging_pitch + now.cogging_phase)
    mechanics.motor_bias[0] = cogging + 0.5 * (backward - forward)
    deflection = max(mechanics.qpos[mechanics.ground] - carriage, 0.0)
    mechanics.tyre[0] = -mechanics.tyre_scale * now.stiffness * stiffness_ratio(now, deflection)


@compilable
def give_way(
    mechanics: Handles, now: Contacts, ground: float, structure: float
) -> tuple[float, float]:
    """How far compliant cylinders will have yielded one timestep ahead: ground and structure, m.

    Their loads are worked out here, as MuJoCo takes the plates' motion as given.

    Parameters
    ----------
    mechanics : Handles
        Whose state is that before the timestep.
    now : Contacts
        As they are now; `yielded` is not changed.
    ground, structure : float
        The plates' velocities without load, m/s.
    """
    h, v, place = (
        mechanics.timestep,
        mechanics.qvel[mechanics.carriage],
        mechanics.qpos[mechanics.carriage],
    )
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
    # What friction has more in one direction stands among the motor's forces already.
    load -= 0.5 * (backward - forward)
    push = tyre - (spring_force(now.gas, -travel) if now.gas.force > 0.0 else 0.0)
    free = structure + (now.structure_unloaded - now.yielded[1]) / (now.structure_lag + h)
    _, cell = solve_yielding(
        rhs=now.mass * v + h * push,
        inertia=inertia,
        timestep=h,
        rail=(h * up, h * down),
        free=free,
        share=share,
        force=load,
        viscous=now.motor_viscous,
        forward=forward,
        backward=backward,
    )
    return ground_ahead, now.yielded[1] + h * (free - structure + share * cell)


@compilable
def true_measurements(mechanics: Handles) -> Measurements:
    """What ideal sensors read of the state last computed by `forward` with its sensors."""
    ground, structure = mechanics.qpos[mechanics.ground], mechanics.qpos[mechanics.structure]
    travel = structure - mechanics.qpos[mechanics.carriage]
    return Measurements(ground, structure, travel, mechanics.sensors[mechanics.load_cell])


@compilable
def sense(state: PlantState) -> Measurements:
    """Ideal measurements now, under the commands held until now.

    The plates move over the coming timestep as those commands would move them: a motor that sticks
    passes on the force that accelerates the carriage with the plate, which a velocity one timestep
    old would not show.
    """
    onward = (
        next_position(state.ground, state.ground_state, state.ground_command.memory[3]),
        next_position(state.structure, state.structure_state, state.structure_command.memory[3]),
    )
    move_plates(state, (state.ground_state.position[0], state.structure_state.position[0]), onward)
    forward(state.mechanics.model, state.mechanics.data, 0, 0)
    return true_measurements(state.mechanics)


@compilable
def move_plates(
    state: PlantState, here: tuple[float, float], there: tuple[float, float]
) -> tuple[float, float]:
    """Prescribes the plates' motion over the coming timestep, ground and structure, m.

    Parameters
    ----------
    state : PlantState
        Whose mechanics are written into.
    here, there : tuple
        Where the cylinders hold them without load, now and one timestep ahead.

    Returns
    -------
    tuple
        How far they will have yielded then.
    """
    mechanics, now = state.mechanics, state.contacts
    ahead = (0.0, 0.0)
    if now.ground_compliance > 0.0 or now.structure_compliance > 0.0:
        h = mechanics.timestep
        touch(mechanics, now)
        ahead = give_way(mechanics, now, (there[0] - here[0]) / h, (there[1] - here[1]) / h)
    drive(mechanics, mechanics.ground, here[0] + now.yielded[0], there[0] + ahead[0])
    drive(mechanics, mechanics.structure, here[1] + now.yielded[1], there[1] + ahead[1])
    touch(mechanics, now)
    brace(mechanics)
    return ahead


@compilable
def advance(
    state: PlantState, ground_command: float, structure_command: float, voltage: float
) -> None:
    """One control period with the commands held."""
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
        here = state.ground_state.position[0], state.structure_state.position[0]
        asked = condition(state.ground_drive, state.ground_command, ground_command)
        advance_cylinder(state.ground, state.ground_state, asked)
        asked = condition(state.structure_drive, state.structure_command, structure_command)
        advance_cylinder(state.structure, state.structure_state, asked)
        mechanics.control[0] = condition(state.motor_drive, state.motor_command, voltage)
        there = state.ground_state.position[0], state.structure_state.position[0]
        now.yielded[0], now.yielded[1] = move_plates(state, here, there)
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
    """The same for a plant whose commands act as they are and whose contacts do not change.

    A third faster.
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
