"""Limits that end a test at once, on raw measurements and on commands before they are written.

The judgement is a plain function of the limits, the earlier ticks and the current tick, so that the
twin's compiled loop and the rig's loop call the same one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers import Commands, Measurements
from controllers.compiled import compilable
from controllers.force import MOTOR_CONSTANT
from rigtwin.components import RigPlant
from rigtwin.description.settings import Safety
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.trip import Trip

MOTOR_LAG = RigPlant().motor.time_constant
"""Time constant of the motor's force behind its voltage, s."""
LEADING = 1.5
"""Largest command of a cylinder, as a multiple of its position limit."""
VELOCITY_SPAN = 10
"""Ticks over which a velocity is averaged before it is compared with its limit, so that noise of
single samples does not count as motion."""


(
    _NONE,
    _STRUCTURE,
    _FORCE,
    _TRAVEL,
    _NOT_A_NUMBER,
    _GROUND,
    _VELOCITY,
    _JUMP,
    _STUCK,
    _FOLLOWING,
    _COMMAND,
    _COMMAND_RATE,
    _WHEEL,
    _MOTOR,
) = (trip.value for trip in Trip)
"""Values of the trips. Looking up an enumeration's value takes longer than the comparison."""


class LimitMemory(NamedTuple):
    """Memory of the limits over earlier ticks; changed in place.

    It consists of arrays for compiled loops, and of lists, which Python reads faster, for others.

    Parameters
    ----------
    measured
        Last measurements, shape (4,); NaN before the first tick.
    repeats
        Number of equal readings in a row, shape (4,).
    commands
        Last commands, shape (4,).
    travel
        Ring buffer of VELOCITY_SPAN samples, m, and its position, shape (VELOCITY_SPAN + 1,).
    motor
        Motor force expected from the voltage, N, shape (1,).
    """

    measured: Array | list[float]
    repeats: Array | list[float]
    commands: Array | list[float]
    travel: Array | list[float]
    motor: Array | list[float]


def empty_memory() -> LimitMemory:
    """Return the memory before the first tick, for a loop in Python."""
    # Comparisons with NaN are false, so nothing trips for want of an earlier tick.
    unknown = [math.nan]
    return LimitMemory(
        4 * unknown, [1.0] * 4, 4 * unknown, (VELOCITY_SPAN + 1) * unknown, 1 * unknown
    )


def empty_memory_arrays() -> LimitMemory:
    """Return the memory before the first tick, for a compiled loop."""
    return LimitMemory(*(np.array(values) for values in empty_memory()))


@compilable
def judge_measurements(
    limits: Safety, period: float, memory: LimitMemory, measured: Measurements
) -> tuple[int, int]:
    """Find the first limit that the measurements of this tick violate.

    Parameters
    ----------
    limits
        Limits of the test.
    period
        Time since the last tick, s.
    memory
        Memory of earlier ticks; changed in place.
    measured
        Measurements of this tick.

    Returns
    -------
    tuple of int
        Number of a Trip, and the column, of `Measurements` or from 4 on of `Commands`.
    """
    for column in range(4):
        if not math.isfinite(measured[column]):
            return _NOT_A_NUMBER, column
    # The memory of all channels must advance even after a trip: find first, return later.
    trip, at = _NONE, 0
    for column in range(4):
        change = abs(measured[column] - memory.measured[column])
        rate = limits.force_rate if column == 3 else limits.lvdt_rate
        if change > rate * period and trip == _NONE:
            trip, at = _JUMP, column
        memory.repeats[column] = memory.repeats[column] + 1.0 if change == 0.0 else 1.0
        if memory.repeats[column] >= limits.stuck and trip == _NONE:
            trip, at = _STUCK, column
        memory.measured[column] = measured[column]
    place = int(memory.travel[VELOCITY_SPAN]) if memory.travel[VELOCITY_SPAN] >= 0.0 else 0
    moved = abs(measured.suspension_lvdt - memory.travel[place])
    memory.travel[place] = measured.suspension_lvdt
    memory.travel[VELOCITY_SPAN] = (place + 1) % VELOCITY_SPAN
    if trip != _NONE:
        return trip, at
    if abs(measured.structure_lvdt) > limits.structure:
        return _STRUCTURE, 1
    if abs(measured.load_cell) > limits.force:
        return _FORCE, 3
    if abs(measured.suspension_lvdt) > limits.travel:
        return _TRAVEL, 2
    if abs(measured.ground_lvdt) > limits.ground:
        return _GROUND, 0
    if moved > limits.velocity * VELOCITY_SPAN * period:
        return _VELOCITY, 2
    # Redundancy: the three LVDTs must agree on a wheel that stands on the ground plate, and the
    # load cell must agree with the motor's voltage.
    if (
        abs(measured.structure_lvdt - measured.suspension_lvdt - measured.ground_lvdt)
        > limits.wheel
    ):
        return _WHEEL, 2
    if abs(measured.load_cell - memory.motor[0]) > limits.motor:
        return _MOTOR, 3
    return _NONE, 0


@compilable
def judge_commands(
    limits: Safety, period: float, memory: LimitMemory, measured: Measurements, commands: Commands
) -> tuple[int, int]:
    """Find the first limit that the commands of this tick violate.

    Commands that pass are remembered as written.

    Parameters
    ----------
    limits
        Limits of the test.
    period
        Time since the last tick, s.
    memory
        Memory of earlier ticks; changed in place.
    measured
        Measurements of this tick.
    commands
        Commands of this tick, before they are written.

    Returns
    -------
    tuple of int
        Number of a Trip, and the column, of `Measurements` or from 4 on of `Commands`.
    """
    for column in range(4):
        if not math.isfinite(commands[column]):
            return _NOT_A_NUMBER, 4 + column
    # A command may exceed the position limit for as long as the cylinder lags behind it.
    if abs(commands.ground) > LEADING * limits.ground:
        return _COMMAND, 4
    if abs(commands.structure) > LEADING * limits.structure:
        return _COMMAND, 5
    for column in (0, 1, 3):
        rate = limits.voltage_rate if column == 3 else limits.command_rate
        if abs(commands[column] - memory.commands[column]) > rate * period:
            return _COMMAND_RATE, 4 + column
    if abs(commands.ground - measured.ground_lvdt) > limits.following:
        return _FOLLOWING, 0
    if abs(commands.structure - measured.structure_lvdt) > limits.following:
        return _FOLLOWING, 1
    if abs(commands.force - measured.load_cell) > limits.following_force:
        return _FOLLOWING, 3
    for column in range(4):
        memory.commands[column] = commands[column]
    # Expected motor force: the voltage through the amplifier's first-order lag.
    share = 1.0 - math.exp(-period / MOTOR_LAG)
    force = memory.motor[0] if math.isfinite(memory.motor[0]) else measured.load_cell
    memory.motor[0] = force + share * (MOTOR_CONSTANT * commands.voltage - force)
    return _NONE, 0


@compilable
def judge_limits(
    limits: Safety, period: float, memory: LimitMemory, measured: Measurements, commands: Commands
) -> tuple[int, int]:
    """Find the first limit that a tick violates.

    Parameters
    ----------
    limits
        Limits of the test.
    period
        Time since the last tick, s.
    memory
        Memory of earlier ticks; changed in place.
    measured, commands
        Measurements of this tick, and its commands before they are written.

    Returns
    -------
    tuple of int
        Number of a Trip, and the column, of `Measurements` or from 4 on of `Commands`.
    """
    trip, column = judge_measurements(limits, period, memory, measured)
    if trip == _NONE:
        trip, column = judge_commands(limits, period, memory, measured, commands)
    return trip, column


def stop_state(limits: Safety, commands: Commands) -> Commands:
    """Return the stop state: no force, and the cylinders at their commands, within their limits."""
    ground = min(max(commands.ground, -limits.ground), limits.ground)
    structure = min(max(commands.structure, -limits.structure), limits.structure)
    return Commands(ground, structure, 0.0, 0.0)


def is_beyond(limits: Safety, measured: Measurements) -> bool:
    """Return whether a cylinder is beyond its limit, or its position is unknown."""
    # Compared this way round, a NaN counts as beyond.
    ground = abs(measured.ground_lvdt) <= limits.ground
    structure = abs(measured.structure_lvdt) <= limits.structure
    return not (ground and structure and abs(measured.suspension_lvdt) <= limits.travel)


def find_arming_obstacle(limits: Safety, measured: Measurements) -> str | None:
    """Find the reason why the rig may not be armed in its present state.

    After a trip, all quantities must be back within their limits by the hysteresis.

    Parameters
    ----------
    limits
        Limits of the test.
    measured
        Present measurements.

    Returns
    -------
    str or None
        Reason, or None if the rig may be armed.
    """
    share = 1.0 - limits.hysteresis
    largest = (limits.ground, limits.structure, limits.travel, limits.force)
    for name, value, limit in zip(Measurements._fields, measured, largest, strict=True):
        if not abs(value) <= share * limit:
            return (
                f"{name} is {value:.4g}; arming needs it within {share * limit:.4g}, "
                f"{100 * share:.0f} % of its limit"
            )
    return None
