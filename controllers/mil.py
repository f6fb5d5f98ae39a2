"""Model in the loop: one tick of the whole controller of the rig.

`update` is a plain function of controller, state, measurements and demand.
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
    advance_motor_model,
    observe_friction,
    step_compensator,
)
from controllers.gas_spring import gas_force
from controllers.plate import Array, Plate, at_rest, compensate, plate
from controllers.settings import Compensator, Mode, Settings, Structure, Travel
from controllers.signals import Commands, Demand, Measurements
from controllers.skyhook import skyhook_force
from controllers.structure import point_mass
from controllers.suspension import suspension_force


class Controller(NamedTuple):
    """Settings, and the models computed from them once per test.

    Attributes
    ----------
    settings : Settings
        Settings of the controller.
    modes : Modes
        Modes of the beam structure.
    plate : Plate
        Delay compensator of the structure plate.
    period : float
        Period of the ticks, s.
    """

    settings: Settings
    modes: Modes
    plate: Plate
    period: float


class MilState(NamedTuple):
    """Memory of the controller between ticks, in m, m/s and N.

    Numbers stand first, then tuples of numbers, whose lengths the defaults give. The memory of the
    plate's compensator stands last; its length depends on the law.
    """

    sample: float = math.nan
    """Last raw travel, m; NaN before the first tick."""
    travel: float = 0.0
    velocity: float = 0.0
    force: float = 0.0
    integral: float = 0.0
    structure_position: float = 0.0
    structure_velocity: float = 0.0
    modal: Six = AT_REST
    """Displacements of the structure's modes; `modal_rates` are their rates."""
    modal_rates: Six = AT_REST
    compensation: Compensation = REST
    velocities: Velocities = NO_VELOCITIES
    errors: Errors = NO_ERRORS
    plate: Array = at_rest(plate(Settings(), 1.0))


def _lay_out(state: MilState) -> dict[str, slice]:
    """Return the place of every field in a packed state."""
    places, first = {}, 0
    for name, value in zip(state._fields[:-1], state[:-1], strict=True):
        last = first + (len(value) if isinstance(value, tuple) else 1)
        places[name], first = slice(first, last), last
    return places


PLACES = _lay_out(MilState())
SIZE = PLACES[MilState._fields[-2]].stop
"""Length of a packed state, without the memory of the plate."""
# Compiled code supports slices that are constants of the module, but no dictionary of them.
_MODAL, _RATES, _COMPENSATION = PLACES["modal"], PLACES["modal_rates"], PLACES["compensation"]
_VELOCITIES, _ERRORS = PLACES["velocities"], PLACES["errors"]
_NUMBERS = slice(0, _MODAL.start)


def controller(settings: Settings, period: float) -> Controller:
    """Return the controller for settings and a period of the ticks, s.

    Raises ValueError if the plate has no compensator with these settings.
    """
    return Controller(settings, modes(settings, period), plate(settings, period), period)


def initial_state(controller: Controller) -> MilState:
    """Return the state before the first tick: the structure model at rest at `start`."""
    settings = controller.settings
    return MilState(
        structure_position=settings.start,
        modal=at_start(settings, controller.modes),
        plate=at_rest(controller.plate),
    )


@compilable
def packed(state: MilState) -> tuple[float, ...]:
    """Return a state as plain numbers, without the memory of the plate."""
    numbers: Any = state[_NUMBERS]
    memory = state.compensation[:] + state.velocities + state.errors
    return numbers + state.modal + state.modal_rates + memory


@compilable
def unpacked(values: tuple[float, ...], plate: Array) -> MilState:
    """Return the state of `SIZE` plain numbers and of the memory of the plate's compensator."""
    numbers: Any = values[_NUMBERS]
    compensation = Compensation(*values[_COMPENSATION])
    tuples = (values[_MODAL], values[_RATES], compensation, values[_VELOCITIES], values[_ERRORS])
    return MilState(*(numbers + tuples + (plate,)))


@compilable
def _filter_measurements(
    controller: Controller, state: MilState, measured: Measurements, demand: Demand
) -> tuple[float, float, float, float]:
    """Return the raw travel, m, and filtered travel, m, velocity, m/s, and force, N."""
    settings, period = controller.settings, controller.period
    sample = measured.suspension_lvdt
    if settings.travel == Travel.GROUND:
        sample = measured.structure_lvdt - measured.ground_lvdt
    elif settings.travel == Travel.MODEL:
        sample = state.structure_position - demand.ground
    if math.isnan(state.sample):
        # First tick: the filters start settled at the first sample.
        return sample, sample, 0.0, measured.load_cell
    rate = (sample - state.sample) / period
    force = low_pass(state.force, measured.load_cell, settings.filter_force, period)
    if settings.travel == Travel.MODEL:
        # The travel of the model has no noise and needs no filter.
        return sample, sample, rate, force
    travel = low_pass(state.travel, sample, settings.filter_position, period)
    velocity = low_pass(state.velocity, rate, settings.filter_velocity, period)
    return sample, travel, velocity, force


class Emulated(NamedTuple):
    """What the models of suspension and structure demand at one tick."""

    force: float
    """Force of the suspension, N."""
    position: float
    velocity: float
    """Motion of the structure, m and m/s."""
    modal: Six
    modal_rates: Six
    """Displacements of the structure's modes, and their rates."""
    plate: Array
    """Memory of the plate's compensator."""
    plate_command: float
    """Command of the plate, m."""


@compilable
def _emulate(
    controller: Controller,
    state: MilState,
    measured: Measurements,
    demand: Demand,
    filtered: tuple[float, float, float],
) -> Emulated:
    """Advance the models of suspension and structure by one tick.

    `filtered` is the filtered travel, m, velocity, m/s, and force, N.
    """
    settings, (travel, velocity, force) = controller.settings, filtered
    modal, modal_rates = state.modal, state.modal_rates
    # Imposed tests bypass the models, and with them the delay compensation.
    if settings.mode == Mode.IMPOSED:
        position = demand.structure
        return Emulated(demand.force, position, 0.0, modal, modal_rates, state.plate, position)
    # The structure's velocity is that of the tick before: this tick's needs the force first.
    skyhook = skyhook_force(settings, state.structure_velocity, velocity)
    demanded = suspension_force(settings, travel, velocity) - skyhook
    body_force = force
    if settings.gas_force > 0.0:
        # The load cell is on the motor's rod. The force of the real gas spring beside it follows
        # from the travel.
        length, exponent = settings.gas_length, settings.gas_exponent
        body_force += gas_force(settings.gas_force, length, exponent, -travel)
    if settings.structure == Structure.BEAM:
        modal, modal_rates = beam(controller.modes, modal, modal_rates, body_force)
        position = centre(controller.modes, modal)
        rate = centre(controller.modes, modal_rates)
    else:
        position, rate = point_mass(
            settings,
            state.structure_position,
            state.structure_velocity,
            body_force,
            controller.period,
        )
    memory, plate_command = compensate(
        controller.plate, state.plate, position, measured.structure_lvdt
    )
    return Emulated(demanded, position, rate, modal, modal_rates, memory, plate_command)


@compilable
def update(
    controller: Controller, state: MilState, measured: Measurements, demand: Demand
) -> tuple[MilState, Commands]:
    """Return the state and the commands after one tick.

    The order is: filters, suspension model and skyhook, structure model, delay compensation of its
    plate, friction compensation, force loop.
    """
    settings, period = controller.settings, controller.period
    sample, travel, velocity, force = _filter_measurements(controller, state, measured, demand)
    models = _emulate(controller, state, measured, demand, (travel, velocity, force))
    compensation, velocities, errors = state.compensation, state.velocities, state.errors
    if settings.compensator == Compensator.OBSERVER:
        compensation = observe_friction(settings, compensation, measured.load_cell, period)
    # Both compensators run before the force loop, whose output they add to.
    elif settings.compensator != Compensator.NONE:
        compensation, velocities, errors = step_compensator(
            settings,
            compensation,
            velocities,
            errors,
            travel=measured.suspension_lvdt,
            error=models.force - force,
            period=period,
        )
    added = compensation.added
    integral, voltage = force_loop(settings, state.integral, models.force, force, added, period)
    compensation = advance_motor_model(compensation, MOTOR_CONSTANT * voltage, period)
    next_state = MilState(
        sample=sample,
        travel=travel,
        velocity=velocity,
        force=force,
        integral=integral,
        structure_position=models.position,
        structure_velocity=models.velocity,
        modal=models.modal,
        modal_rates=models.modal_rates,
        compensation=compensation,
        velocities=velocities,
        errors=errors,
        plate=models.plate,
    )
    return next_state, Commands(demand.ground, models.plate_command, models.force, voltage)
