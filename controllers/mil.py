"""Model in the loop: one tick of the whole rig controller.

A plain function of controller, state, measurements and demand.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controllers.beam import AT_REST, Modes, Six, at_start, beam, centre, modes
from controllers.compiled import compilable
from controllers.filters import low_pass
from controllers.force import MOTOR_CONSTANT, force_loop
from controllers.friction import (
    NO_ERRORS,
    NO_VELOCITIES,
    REST,
    Compensation,
    Errors,
    Velocities,
    observed,
    pushed,
    stepped,
)
from controllers.gas_spring import gas_force
from controllers.plate import Array, Plate, at_rest, compensate, plate
from controllers.settings import Compensator, Mode, Settings, Structure, Travel
from controllers.signals import Commands, Demand, Measurements
from controllers.skyhook import skyhook_force
from controllers.structure import point_mass
from controllers.suspension import suspension_force


class Controller(NamedTuple):
    """Settings and what follows from them once a test. period in s."""

    settings: Settings
    modes: Modes
    plate: Plate
    period: float


class State(NamedTuple):
    """What the controller remembers from tick to tick. Positions m, velocities m/s, forces N.

    Numbers stand first, then tuples of numbers, whose lengths the defaults give; last what the
    plate's compensator remembers, as many numbers as its law has.
    """

    sample: float = math.nan
    """The last raw travel; not a number before the first tick."""
    travel: float = 0.0
    velocity: float = 0.0
    force: float = 0.0
    integral: float = 0.0
    structure_position: float = 0.0
    structure_velocity: float = 0.0
    modal: Six = AT_REST
    """Displacements of the structure's modes, and their rates."""
    modal_rates: Six = AT_REST
    compensation: Compensation = REST
    velocities: Velocities = NO_VELOCITIES
    errors: Errors = NO_ERRORS
    plate: Array = at_rest(plate(Settings(), 1.0))


def _lay_out(state: State) -> dict[str, slice]:
    """Field → where its numbers stand in a packed state."""
    places, first = {}, 0
    for name, value in zip(state._fields[:-1], state[:-1], strict=True):
        last = first + (len(value) if isinstance(value, tuple) else 1)
        places[name], first = slice(first, last), last
    return places


PLACES = _lay_out(State())
SIZE = PLACES[State._fields[-2]].stop
"""Numbers in a packed state, but for the plate's."""
# Compiled code knows slices that are constants of the module, and no tables of them.
_MODAL, _RATES, _COMPENSATION = PLACES["modal"], PLACES["modal_rates"], PLACES["compensation"]
_VELOCITIES, _ERRORS = PLACES["velocities"], PLACES["errors"]
_NUMBERS = slice(0, _MODAL.start)


def controller(settings: Settings, period: float) -> Controller:
    """What `update` needs, from settings and the period of the ticks in s. Raises ValueError if
    there is no such compensator of the plate."""
    return Controller(settings, modes(settings, period), plate(settings, period), period)


def initial_state(controller: Controller) -> State:
    """The state before the first tick: the structure model at rest at `start`."""
    settings = controller.settings
    return State(
        structure_position=settings.start,
        modal=at_start(settings, controller.modes),
        plate=at_rest(controller.plate),
    )


@compilable
def packed(state: State) -> tuple[float, ...]:
    """The state as plain numbers, but for the plate's."""
    numbers: Any = state[_NUMBERS]
    memory = state.compensation[:] + state.velocities + state.errors
    return numbers + state.modal + state.modal_rates + memory


@compilable
def unpacked(values: tuple[float, ...], plate: Array) -> State:
    """The state of its plain numbers, SIZE of them, and what the plate's compensator remembers."""
    numbers: Any = values[_NUMBERS]
    compensation = Compensation(*values[_COMPENSATION])
    tuples = (values[_MODAL], values[_RATES], compensation, values[_VELOCITIES], values[_ERRORS])
    return State(*(numbers + tuples + (plate,)))


@compilable
def update(
    controller: Controller,
    state: State,
    measured: Measurements,
    demand: Demand,
) -> tuple[State, Commands]:
    """One tick: filters, suspension model and skyhook, friction compensation, force loop, structure
    model, delay compensation of its plate."""
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
        rate = (sample - state.sample) / period
        velocity = low_pass(state.velocity, rate, settings.filter_velocity, period)
        force = low_pass(state.force, measured.load_cell, settings.filter_force, period)

    modal, modal_rates = state.modal, state.modal_rates
    memory = state.plate
    if settings.mode == Mode.IMPOSED:
        demanded = demand.force
        position, structure_velocity = demand.structure, 0.0
        asked = position
    else:
        skyhook = skyhook_force(settings, state.structure_velocity, velocity)
        demanded = suspension_force(settings, travel, velocity) - skyhook
        carried = force
        if settings.gas_force > 0.0:
            # The load cell is on the motor's rod; what the real spring beside it carries follows
            # from its travel.
            length, exponent = settings.gas_length, settings.gas_exponent
            carried += gas_force(settings.gas_force, length, exponent, -travel)
        if settings.structure == Structure.BEAM:
            modal, modal_rates = beam(controller.modes, modal, modal_rates, carried)
            position = centre(controller.modes, modal)
            structure_velocity = centre(controller.modes, modal_rates)
        else:
            position, structure_velocity = point_mass(
                settings, state.structure_position, state.structure_velocity, carried, period
            )
        memory, asked = compensate(controller.plate, memory, position, measured.structure_lvdt)
    compensation, velocities, errors = state.compensation, state.velocities, state.errors
    if settings.compensator == Compensator.OBSERVER:
        compensation = observed(settings, compensation, measured.load_cell, period)
    elif settings.compensator != Compensator.NONE:
        compensation, velocities, errors = stepped(
            settings,
            compensation,
            velocities,
            errors,
            travel=measured.suspension_lvdt,
            error=demanded - force,
            period=period,
        )
    added = compensation.added
    integral, voltage = force_loop(settings, state.integral, demanded, force, added, period)
    compensation = pushed(compensation, MOTOR_CONSTANT * voltage, period)
    after = State(
        sample=sample,
        travel=travel,
        velocity=velocity,
        force=force,
        integral=integral,
        structure_position=position,
        structure_velocity=structure_velocity,
        modal=modal,
        modal_rates=modal_rates,
        compensation=compensation,
        velocities=velocities,
        errors=errors,
        plate=memory,
    )
    return after, Commands(demand.ground, asked, demanded, voltage)
