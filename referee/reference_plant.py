"""The referee's rig, written from the same description as the twin but without any of its code.

The integration step is 50 µs. The contact of the tyre sets in over a tenth of a millimetre.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from referee.reference_friction import (
    Bounds,
    bristle_force,
    dry_bounds,
    end_of_play,
    plate_under_load,
    slide,
)
from referee.reference_signals import hydraulic_step, pass_command, reading, settle, take_up
from referee.reference_truth import STEP, Array, Truth

ONSET = 1e-4
"""Deflection over which the contact of the tyre sets in, m."""


class ReferenceBody(NamedTuple):
    """State of the rig, changed in place.

    Attributes
    ----------
    motion : ndarray
        Motion of the rig, entries as named below, shape (19,).
    histories : ndarray
        Rings of past commands: voltage, ground, structure, shape (3, 2048).
    memories : ndarray
        Rate limit, lag and dead zone of these commands, shape (3, 3).
    sensed : ndarray
        Rings of past values of the sensors, shape (4, 64).
    lags : ndarray
        Lags of the sensors, shape (4, 1).
    ground_z, structure_z : ndarray
        States of the hydraulics, shape (4,).
    """

    motion: Array
    histories: Array
    memories: Array
    sensed: Array
    lags: Array
    ground_z: Array
    structure_z: Array


# Entries of `ReferenceBody.motion`, in m, N and s.
GROUND, STRUCTURE, POSITION, VELOCITY, FORCE = range(5)  # Plates, carriage, motor force.
RELAXED, BRISTLE_RAIL, BRISTLE_ROD = range(5, 8)  # Relaxed deflection of the tyre, bristles.
RAIL_END, ROD_END = range(8, 10)  # Trailing ends of the play of rail and rod.
GROUND_YIELD, STRUCTURE_YIELD = range(10, 12)  # Yielding of the plates.
GROUND_BEFORE, STRUCTURE_BEFORE = range(12, 14)  # The same a step ago.
ACCELERATION, CELL_FORCE, STEPS = range(
    14, 17
)  # Acceleration of the carriage, load cell, steps so far.
GROUND_PISTON, STRUCTURE_PISTON = range(17, 19)  # Pistons of the cylinders.


@numba.njit(cache=True, nogil=True)
def at_rest(
    truth: Truth, ground_command: float, structure_command: float, preload: float
) -> ReferenceBody:
    """Return the state before the first tick.

    Everything rests, the commands, m, have been constant for a long time, and tyre and motor carry
    the preload, N.
    """
    body = ReferenceBody(
        np.zeros(19),
        np.empty((3, 2048)),
        np.zeros((3, 3)),
        np.empty((4, 64)),
        np.zeros((4, 1)),
        np.zeros(4),
        np.zeros(4),
    )
    ground = ground_command * truth.ground.gain
    # The tyre carries the preload, so the carriage stands lower by its deflection.
    x = ground - preload / truth.tyre
    settle(body.ground_z, ground, truth.ground_hydraulic)
    settle(body.structure_z, x, truth.structure_hydraulic)
    # As if these commands had been held for longer than any delay.
    first = (preload / truth.motor_constant, ground_command, structure_command)
    for number in range(3):
        body.histories[number, :] = first[number]
    body.memories[0, 0] = body.memories[0, 1] = first[0] * truth.voltage.gain
    body.memories[1, 0] = body.memories[1, 1] = first[1] * truth.ground.gain
    body.memories[2, 0] = body.memories[2, 1] = first[2] * truth.structure.gain
    body.memories[1, 2], body.memories[2, 2] = first[1], first[2]
    motion = body.motion
    motion[GROUND], motion[STRUCTURE], motion[POSITION], motion[RAIL_END] = ground, x, x, x
    motion[FORCE] = motion[CELL_FORCE] = preload
    motion[GROUND_PISTON], motion[STRUCTURE_PISTON] = ground, x
    return body


@numba.njit(cache=True, nogil=True)
def true_values(body: ReferenceBody) -> tuple[float, float, float, float]:
    """Return the readings of ideal sensors: ground, structure and travel, m, and load cell, N."""
    motion = body.motion
    ground = motion[GROUND] + motion[GROUND_YIELD]
    structure = motion[STRUCTURE] + motion[STRUCTURE_YIELD]
    return ground, structure, structure - motion[POSITION], motion[CELL_FORCE]


@numba.njit(cache=True, nogil=True)
def sample(truth: Truth, body: ReferenceBody, tick: int, noise: Array, out: Array) -> None:
    """Write the samples of all sensors at a tick into `out`, shape (4,); noise: shape (4,)."""
    values = true_values(body)
    sensors = (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
    for number in range(4):
        out[number] = reading(
            sensors[number],
            values[number],
            body.motion[ACCELERATION],
            body.sensed[number],
            body.lags[number],
            tick,
            noise[number],
        )


@numba.njit(cache=True, nogil=True)
def tyre_force(
    truth: Truth, deflection: float, squeeze: float, relaxed: float
) -> tuple[float, float]:
    """Return the force of the tyre, N, and its relaxed deflection after a step, m.

    deflection: m, positive in compression; squeeze: its rate, m/s.
    """
    # A hyperbola instead of max(deflection, 0): the contact sets in smoothly over `ONSET`. The
    # second term keeps the force at the working point, 4 mm, unchanged.
    contact = (
        0.5 * (deflection + math.sqrt(deflection * deflection + ONSET * ONSET))
        - 0.25 * ONSET**2 / 0.004
    )
    # Standard linear solid: a share of the stiffness relaxes towards the present deflection.
    relaxed += STEP / truth.relaxing_time * (contact - relaxed)
    tyre = truth.tyre * (contact * (1.0 + truth.tyre_hardening * contact))
    tyre += truth.relaxing * truth.tyre * (contact - relaxed)
    tyre += truth.tyre_damping * squeeze if deflection > 0.0 else 0.0
    # A tyre pushes only.
    return max(tyre, 0.0) if contact > 0.0 else 0.0, relaxed


@numba.njit(cache=True, nogil=True)
def drive_actuators(
    truth: Truth, body: ReferenceBody, commands: Array, time: float
) -> tuple[float, float, float]:
    """Advance the commands' paths and the pistons by one step.

    Returns the voltage, V, and the next positions of ground and structure plate, m.
    """
    motion, count, late = body.motion, int(body.motion[STEPS]), truth.computation_delay
    paths, rings = body.memories, body.histories
    voltage = pass_command(truth.voltage, paths[0], rings[0], count, commands[3], True, time, late)
    # The amplifier ends at ±10 V, the motor at ±1860 N.
    most = 1860.0 / truth.motor_constant
    voltage = max(-most, min(most, max(-10.0, min(10.0, voltage))))
    ground_command = pass_command(
        truth.ground, paths[1], rings[1], count, commands[0], False, time, late
    )
    structure_command = pass_command(
        truth.structure, paths[2], rings[2], count, commands[1], False, time, late
    )
    motion[STEPS] = count + 1
    motion[GROUND_PISTON] = hydraulic_step(
        truth.ground_hydraulic, body.ground_z, motion[GROUND_PISTON], ground_command
    )
    motion[STRUCTURE_PISTON] = hydraulic_step(
        truth.structure_hydraulic, body.structure_z, motion[STRUCTURE_PISTON], structure_command
    )
    ground = take_up(truth.ground_hydraulic, motion[GROUND], motion[GROUND_PISTON])
    structure = take_up(truth.structure_hydraulic, motion[STRUCTURE], motion[STRUCTURE_PISTON])
    return voltage, ground, structure


@numba.njit(cache=True, nogil=True)
def friction_bounds(truth: Truth, motion: Array, sliding: float, rod_position: float) -> Bounds:
    """Return the bounds of dry friction, N: the rail's up and down, the rod's up and down.

    sliding, rod_position: velocity, m/s, and position, m, of the plate against the carriage.
    """
    x = motion[POSITION]
    rail_up, rail_down = dry_bounds(truth.rail, motion[VELOCITY], x)
    rod_up, rod_down = dry_bounds(truth.motor, sliding, rod_position)
    # Friction behind a play is felt only at the play's ends.
    if truth.rail.play > 0.0:
        motion[RAIL_END], up, down = end_of_play(truth.rail.play, x, motion[RAIL_END])
        rail_up, rail_down = rail_up if up else 0.0, rail_down if down else 0.0
    if truth.motor.play > 0.0:
        motion[ROD_END], up, down = end_of_play(truth.motor.play, rod_position, motion[ROD_END])
        rod_up, rod_down = rod_up if up else 0.0, rod_down if down else 0.0
    return rail_up, rail_down, rod_up, rod_down


@numba.njit(cache=True, nogil=True)
def move_carriage(
    truth: Truth, motion: Array, plate: float, push: float, bounds: Bounds
) -> tuple[float, float, float]:
    """Return the next velocity of the carriage, m/s, and the rod's viscous and dry friction, N.

    plate: velocity of the structure plate, m/s; push: all other forces on the carriage, N; bounds:
    of dry friction, by `friction_bounds`.
    """
    v, (rail_up, rail_down, rod_up, rod_down) = motion[VELOCITY], bounds
    if truth.bristle <= 0.0:
        return slide(truth, v, plate, push, bounds)
    sliding = plate - v
    viscous = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
    # The bristle sees the bound of the direction in which it is bent further.
    bound = rail_up if v > 0.0 else rail_down
    rail_force, motion[BRISTLE_RAIL] = bristle_force(
        truth.bristle, truth.mass, motion[BRISTLE_RAIL], v, bound
    )
    bound = rod_up if sliding > 0.0 else rod_down
    rod_force, motion[BRISTLE_ROD] = bristle_force(
        truth.bristle, truth.mass, motion[BRISTLE_ROD], sliding, bound
    )
    v += STEP / truth.mass * (push + viscous - rail_force + rod_force)
    return v, viscous, rod_force


@numba.njit(cache=True, nogil=True)
def advance_step(truth: Truth, body: ReferenceBody, commands: Array, time: float) -> None:
    """Advance the rig by one step; arguments as in `advance`."""
    motion, yielding = body.motion, truth.structure_hydraulic.compliance > 0.0
    voltage, next_ground, next_structure = drive_actuators(truth, body, commands, time)
    ground, structure, x, v = motion[GROUND], motion[STRUCTURE], motion[POSITION], motion[VELOCITY]
    ground_yield, structure_yield = motion[GROUND_YIELD], motion[STRUCTURE_YIELD]
    # Forces on the carriage at the old position, with the velocities over this step. Rates over
    # this step come from differences, so yielding and play are included.
    squeeze = (next_ground - ground + ground_yield - motion[GROUND_BEFORE]) / STEP - v
    tyre, motion[RELAXED] = tyre_force(truth, ground + ground_yield - x, squeeze, motion[RELAXED])
    plate = (next_structure - structure + structure_yield - motion[STRUCTURE_BEFORE]) / STEP
    rod_position = structure + structure_yield - x
    ripple = truth.ripple * math.sin(
        2.0 * math.pi * rod_position / truth.ripple_pitch + truth.ripple_phase
    )
    bounds = friction_bounds(truth, motion, plate - v, rod_position)
    smooth_rail = truth.rail.viscous * v + truth.rail.drag * v * abs(v)
    carriage_force = tyre - motion[FORCE] - ripple - smooth_rail
    unloaded, load = (next_structure - structure) / STEP, 0.0
    if yielding:
        pull = motion[FORCE] + ripple
        load = plate_under_load(truth, v, unloaded, structure_yield, pull, carriage_force, bounds)
        compression = truth.structure_hydraulic.compliance * load - structure_yield
        plate = unloaded + compression / (truth.load_lag + STEP)
    motion[VELOCITY], smooth_rod, rod_force = move_carriage(
        truth, motion, plate, carriage_force, bounds
    )
    # The acceleration feeds the crosstalk of the load cell.
    motion[ACCELERATION] = (motion[VELOCITY] - v) / STEP
    motion[POSITION] += STEP * motion[VELOCITY]
    # Exact step of the motor's lag, with the voltage constant over it.
    motion[FORCE] += (1.0 - math.exp(-STEP / truth.electrical_lag)) * (
        truth.motor_constant * voltage - motion[FORCE]
    )
    motion[CELL_FORCE] = motion[FORCE] + ripple - smooth_rod - rod_force
    # The yielding of a step ago gives the plate's velocity in the next step.
    motion[GROUND_BEFORE], motion[STRUCTURE_BEFORE] = ground_yield, structure_yield
    motion[GROUND_YIELD] += (
        STEP / (truth.load_lag + STEP) * (-truth.ground_hydraulic.compliance * tyre - ground_yield)
    )
    if yielding:
        motion[STRUCTURE_YIELD] += STEP * (plate - unloaded)
        # If rod and rail both stick, only the deflection of the plate determines the force.
        motion[CELL_FORCE] = load
    motion[GROUND], motion[STRUCTURE] = next_ground, next_structure


@numba.njit(cache=True, nogil=True)
def advance(truth: Truth, body: ReferenceBody, commands: Array, time: float) -> None:
    """Advance the rig by one tick.

    commands: ground, m, structure, m, force, N, which is ignored, and voltage, V, shape (4,); time:
    of the tick, s.
    """
    for _ in range(round(1e-3 / STEP)):
        advance_step(truth, body, commands, time)
