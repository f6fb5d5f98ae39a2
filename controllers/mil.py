"""Model in the loop: one tick of the whole rig controller, a plain function of (controller, state, measurements, demand)."""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.beam import AT_REST, Modes, Six, at_start, beam, centre, modes
from controllers.compiled import compilable
from controllers.filters import low_pass
from controllers.force import MOTOR_CONSTANT, force_loop
from controllers.friction import NO_ERRORS, NO_VELOCITIES, REST, Compensation, Errors, Velocities, observed, pushed, stepped
from controllers.gas_spring import gas_force
from controllers.settings import Compensator, Mode, Settings, Structure, Travel
from controllers.signals import Commands, Demand, Measurements
from controllers.skyhook import skyhook_force
from controllers.structure import point_mass
from controllers.suspension import suspension_force


class Controller(NamedTuple):
    """Settings and what follows from them once a test. period in s."""

    settings: Settings
    modes: Modes
    period: float


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
    modal: Six
    """Displacements of the structure's modes, and their rates."""
    modal_rates: Six
    compensation: Compensation
    velocities: Velocities
    errors: Errors


def controller(settings: Settings, period: float) -> Controller:
    """What `update` needs, from settings and the period of the ticks in s."""
    return Controller(settings, modes(settings, period), period)


def initial_state(controller: Controller) -> State:
    """The state before the first tick: the structure model at rest at `start`."""
    settings = controller.settings
    modal = at_start(settings, controller.modes)
    return State(math.nan, 0.0, 0.0, 0.0, 0.0, settings.start, 0.0, modal, AT_REST, REST, NO_VELOCITIES, NO_ERRORS)


@compilable
def packed(state: State) -> tuple[float, ...]:
    """The state as plain numbers."""
    return state[:7] + state[7] + state[8] + state[9][:] + state[10] + state[11]


SIZE = 7 + 6 + 6 + len(REST) + len(NO_VELOCITIES) + len(NO_ERRORS)
"""Numbers in a packed state."""


@compilable
def unpacked(values: tuple[float, ...]) -> State:
    """The state of its plain numbers, SIZE of them."""
    return State(
        values[0],
        values[1],
        values[2],
        values[3],
        values[4],
        values[5],
        values[6],
        values[7:13],
        values[13:19],
        Compensation(*values[19:33]),
        values[33:50],
        values[50:56],
    )


@compilable
def update(controller: Controller, state: State, measured: Measurements, demand: Demand) -> tuple[State, Commands]:
    """One tick: filters, suspension model with skyhook, friction compensation, force loop, structure model."""
    settings, period = controller.settings, controller.period
    sample = measured.suspension_lvdt
    if settings.travel == Travel.GROUND:
        sample = measured.structure_lvdt - measured.ground_lvdt
    elif settings.travel == Travel.MODEL:
        sample = state.structure_position - demand.ground
    if math.isnan(state.sample):
        travel, velocity, force = sample, 0.0, measured.load_cell
    elif settings.travel == Travel.MODEL:
        travel, velocity = sample, (sample - state.sample) / period
        force = low_pass(state.force, measured.load_cell, settings.filter_force, period)
    else:
        travel = low_pass(state.travel, sample, settings.filter_position, period)
        velocity = low_pass(state.velocity, (sample - state.sample) / period, settings.filter_velocity, period)
        force = low_pass(state.force, measured.load_cell, settings.filter_force, period)

    modal, modal_rates = state.modal, state.modal_rates
    if settings.mode == Mode.IMPOSED:
        demanded = demand.force
        position, structure_velocity = demand.structure, 0.0
    else:
        demanded = suspension_force(settings, travel, velocity) - skyhook_force(settings, state.structure_velocity, velocity)
        carried = force
        if settings.gas_force > 0.0:
            # The load cell is on the motor's rod; what the real spring beside it carries follows from its travel.
            carried += gas_force(settings.gas_force, settings.gas_length, settings.gas_exponent, -travel)
        if settings.structure == Structure.BEAM:
            modal, modal_rates = beam(controller.modes, modal, modal_rates, carried)
            position, structure_velocity = centre(controller.modes, modal), centre(controller.modes, modal_rates)
        else:
            position, structure_velocity = point_mass(
                settings, state.structure_position, state.structure_velocity, carried, period
            )
    compensation, velocities, errors = state.compensation, state.velocities, state.errors
    if settings.compensator == Compensator.OBSERVER:
        compensation = observed(settings, compensation, measured.load_cell, period)
    elif settings.compensator != Compensator.NONE:
        compensation, velocities, errors = stepped(
            settings, compensation, velocities, errors, measured.suspension_lvdt, demanded - force, period
        )
    integral, voltage = force_loop(settings, state.integral, demanded, force, compensation.added, period)
    compensation = pushed(compensation, MOTOR_CONSTANT * voltage, period)
    after = State(
        sample,
        travel,
        velocity,
        force,
        integral,
        position,
        structure_velocity,
        modal,
        modal_rates,
        compensation,
        velocities,
        errors,
    )
    return after, Commands(demand.ground, position, demanded, voltage)
