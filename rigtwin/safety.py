"""Trips: what ends a test at once. Looks at raw measurements, before any filter, on twin and rig alike."""

from __future__ import annotations

import math
from enum import IntEnum

from controllers import Commands, Measurements
from controllers.compiled import compilable
from rigtwin.configuration import Safety


class Trip(IntEnum):
    """Why a test ended early."""

    NONE = 0
    STRUCTURE = 1
    FORCE = 2
    TRAVEL = 3
    NOT_A_NUMBER = 4


@compilable
def tripped(limits: Safety, measured: Measurements, commands: Commands) -> Trip:
    """The first limit violated at this tick."""
    total = measured.ground_lvdt + measured.structure_lvdt + measured.suspension_lvdt + measured.load_cell
    total += commands.ground + commands.structure + commands.force + commands.voltage
    if not math.isfinite(total):
        return Trip.NOT_A_NUMBER
    if abs(measured.structure_lvdt) > limits.structure:
        return Trip.STRUCTURE
    if abs(measured.load_cell) > limits.force:
        return Trip.FORCE
    if abs(measured.suspension_lvdt) > limits.travel:
        return Trip.TRAVEL
    return Trip.NONE


def explained(trip: Trip, limits: Safety) -> str:
    """One line for the operator."""
    return {
        Trip.NONE: "completed",
        Trip.STRUCTURE: f"trip: |structure_lvdt| above {limits.structure:g} m",
        Trip.FORCE: f"trip: |load_cell| above {limits.force:g} N",
        Trip.TRAVEL: f"trip: |suspension_lvdt| above {limits.travel:g} m, the motor's stroke",
        Trip.NOT_A_NUMBER: "trip: a measurement or command is not a finite number",
    }[trip]
