"""Trips of the safety limits, and what a user reads about them."""

from __future__ import annotations

from enum import IntEnum

from controllers import Commands, Measurements
from rigtwin.description.settings import Safety


class Trip(IntEnum):
    """Limit that ended a test early."""

    NONE = 0
    STRUCTURE = 1
    FORCE = 2
    TRAVEL = 3
    NOT_A_NUMBER = 4
    GROUND = 5
    VELOCITY = 6
    JUMP = 7
    STUCK = 8
    FOLLOWING = 9
    COMMAND = 10
    COMMAND_RATE = 11
    WHEEL = 12
    MOTOR = 13


def explain_trip(trip: Trip, limits: Safety, column: int = 0) -> str:
    """Explain a trip in one line for the operator.

    Parameters
    ----------
    trip
        Limit that ended the test.
    limits
        Limits of the test.
    column
        Column of `Measurements`, or from 4 on of `Commands`.

    Returns
    -------
    str
        Explanation with limit and unit.
    """
    name = (*Measurements._fields, *(f"command of {field}" for field in Commands._fields))[column]
    lvdt, rate = ("m", limits.lvdt_rate) if column != 3 else ("N", limits.force_rate)
    command, change = ("m", limits.command_rate) if column != 7 else ("V", limits.voltage_rate)
    error, following = ("m", limits.following) if column != 3 else ("N", limits.following_force)
    return {
        Trip.NONE: "completed",
        Trip.STRUCTURE: f"trip: |structure_lvdt| above {limits.structure:g} m",
        Trip.FORCE: f"trip: |load_cell| above {limits.force:g} N",
        Trip.TRAVEL: f"trip: |suspension_lvdt| above {limits.travel:g} m, the motor's stroke",
        Trip.NOT_A_NUMBER: f"trip: {name} is not a finite number",
        Trip.GROUND: f"trip: |ground_lvdt| above {limits.ground:g} m",
        Trip.VELOCITY: f"trip: suspension_lvdt moves faster than {limits.velocity:g} m/s",
        Trip.JUMP: f"trip: {name} jumps by more than {rate:g} {lvdt}/s allow between two ticks: "
        "sensor or cable",
        Trip.STUCK: f"trip: {name} gave {limits.stuck:g} times the same reading: "
        "sensor stuck or cable off",
        Trip.FOLLOWING: f"trip: {name} is more than {following:g} {error} off its command",
        Trip.COMMAND: f"trip: {name} is beyond its limit",
        Trip.WHEEL: f"trip: the three LVDTs put the wheel over {limits.wheel:g} m off the ground "
        "plate: one of them is wrong",
        Trip.MOTOR: f"trip: load_cell is over {limits.motor:g} N off the force of the motor's "
        "voltage: sensor or amplifier",
        Trip.COMMAND_RATE: f"trip: {name} changes faster than {change:g} {command}/s",
    }[trip]
