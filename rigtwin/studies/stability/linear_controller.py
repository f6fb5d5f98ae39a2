"""A controller as a linear discrete system."""

from __future__ import annotations

import math

import numpy as np

from controllers import (
    SIZE,
    Compensator,
    Demand,
    Measurements,
    PlateCompensator,
    Settings,
    Skyhook,
    initial_state,
    packed,
    unpacked,
    update,
)
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.numerics.arrays import Array

PERTURBATION = 1e-6
"""Perturbation of each variable, in its unit; far below every threshold of the controllers."""
MOVED = np.array([1, 3])
"""Columns of Commands that close a loop through the plant: structure and voltage."""


def unit(size: int, place: int) -> Array:
    """Return a unit vector."""
    row = np.zeros(size)
    row[place] = 1.0
    return row


def linear_controller(
    configuration: Configuration,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Linearise the controller at rest.

    Returns
    -------
    tuple of two pairs
        Next state, by state (SIZE, SIZE) and by plate, travel and load cell (SIZE, 3); the two
        acting commands, by state (2, SIZE) and by sensors (2, 3).
    """
    settings = _affine(configuration.controller)
    controlling = set_up(settings, configuration.timing.period)
    demand = Demand(0.0, settings.start, settings.preload)
    # At rest the structure model carries its weight, so that nothing moves.
    rest = np.array([0.0, settings.start, 0.0, settings.sprung_mass * settings.gravity])
    start = initial_state(controlling)
    # One tick at rest fills the filters' memories, which start empty.
    state, _ = update(controlling, start, Measurements(*rest.tolist()), demand)
    numbers = np.array(packed(state), dtype=float)

    def tick(state: Array, measured: Array) -> Array:
        after, commands = update(
            controlling,
            unpacked(tuple(state.tolist()), start.plate),
            Measurements(*measured.tolist()),
            demand,
        )
        return np.concatenate([np.array(packed(after), dtype=float), np.array(commands)[MOVED]])

    def slope(offset: Array, of_state: bool) -> Array:
        if of_state:
            ends = [tick(numbers + sign * offset, rest) for sign in (1.0, -1.0)]
        else:
            ends = [tick(numbers, rest + sign * offset) for sign in (1.0, -1.0)]
        change = (ends[0] - ends[1]) / (2.0 * PERTURBATION)
        # Differences within the rounding of both ends are set to zero: a spurious entry would
        # connect states that are not connected.
        noise = 1e-15 * np.maximum(np.abs(ends[0]), np.abs(ends[1])) / PERTURBATION * 10.0
        return np.where(np.abs(change) > noise, change, 0.0)

    by_state = np.column_stack(
        [slope(PERTURBATION * unit(SIZE, place), True) for place in range(SIZE)]
    )
    by_sensor = np.column_stack(
        [slope(PERTURBATION * unit(4, place), False) for place in (1, 2, 3)]
    )
    return (by_state[:SIZE], by_sensor[:SIZE]), (by_state[SIZE:], by_sensor[SIZE:])


def _affine(settings: Settings) -> Settings:
    """Return settings with which the controller is affine around rest."""
    # A semi-active damper switches with the sign of a velocity, which is not linear; its minimum is
    # the least damped case.
    if settings.skyhook == Skyhook.SEMI_ACTIVE:
        least = settings.suspension_damping + settings.damping_min
        settings = settings._replace(skyhook=Skyhook.NONE, suspension_damping=least)
    if settings.compensator not in (Compensator.NONE, Compensator.OBSERVER):
        settings = settings._replace(compensator=Compensator.NONE)
    # The plate's compensator is a linear law, which the loop has beside the controller.
    return settings._replace(voltage_limit=math.inf, plate_compensator=PlateCompensator.NONE)
