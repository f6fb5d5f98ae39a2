"""Model in the loop: one tick of the whole rig controller, a plain function of (settings, state, measurements, demand)."""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.compiled import compilable
from controllers.filters import low_pass
from controllers.force import force_loop
from controllers.settings import Mode, Settings, Travel
from controllers.signals import Commands, Demand, Measurements
from controllers.skyhook import skyhook_force
from controllers.structure import point_mass
from controllers.suspension import suspension_force


class State(NamedTuple):
    """What the controller remembers from tick to tick, all floats. Positions m, velocities m/s, forces N."""

    sample: float
    """The last raw travel; not a number before the first tick."""
    travel: float
    velocity: float
    force: float
    integral: float
    structure_position: float
    structure_velocity: float


@compilable
def initial_state(settings: Settings) -> State:
    """The state before the first tick: the structure model at rest at `start`."""
    return State(math.nan, 0.0, 0.0, 0.0, 0.0, settings.start, 0.0)


@compilable
def update(settings: Settings, state: State, measured: Measurements, demand: Demand, period: float) -> tuple[State, Commands]:
    """One tick: filters, suspension model with skyhook, force loop, structure model. period in s."""
    sample = measured.suspension_lvdt
    if settings.travel == Travel.GROUND:
        sample = measured.structure_lvdt - measured.ground_lvdt
    if math.isnan(state.sample):
        travel, velocity, force = sample, 0.0, measured.load_cell
    else:
        travel = low_pass(state.travel, sample, settings.filter_position, period)
        velocity = low_pass(state.velocity, (sample - state.sample) / period, settings.filter_velocity, period)
        force = low_pass(state.force, measured.load_cell, settings.filter_force, period)

    if settings.mode == Mode.IMPOSED:
        demanded = demand.force
        position, structure_velocity = demand.structure, 0.0
    else:
        demanded = suspension_force(settings, travel, velocity) - skyhook_force(settings, state.structure_velocity, velocity)
        position, structure_velocity = point_mass(settings, state.structure_position, state.structure_velocity, force, period)
    integral, voltage = force_loop(settings, state.integral, demanded, force, period)
    after = State(sample, travel, velocity, force, integral, position, structure_velocity)
    return after, Commands(demand.ground, position, demanded, voltage)
