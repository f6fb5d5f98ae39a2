"""What the structure model did during a test: the controller run again on what was measured."""

from __future__ import annotations

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    Measurements,
    Mode,
    PlateCompensator,
    Settings,
    Structure,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.mil import PLACES
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import RigControl, set_up
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording


@kernel
def _states(
    controlling: Controller,
    start: Array,
    plate: Array,
    measured: Array,
    demands: Array,
    out: Array,
) -> None:
    state = unpacked(to_fixed_tuple(start, SIZE), plate)  # type: ignore[call-arg]
    for tick in range(len(measured)):
        sample = Measurements(
            measured[tick, 0], measured[tick, 1], measured[tick, 2], measured[tick, 3]
        )
        state, _ = update(
            controlling, state, sample, Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2])
        )
        numbers = packed(state)
        for number in range(SIZE):
            out[tick, number] = numbers[number]


def states(settings: Settings, period: float, measured: Array, demands: Array) -> Array:
    """The controller's packed state after every tick, shape (ticks, SIZE).

    measured: shape (ticks,
    4), columns of controllers.Measurements; demands: shape (ticks, 3), of
    controllers.Demand;
    period: s.
    """
    controlling = set_up(settings, period)
    out = np.empty((len(measured), SIZE))
    start = initial_state(controlling)
    _states(
        controlling,
        np.array(packed(start)),
        start.plate,
        np.ascontiguousarray(measured),
        np.ascontiguousarray(demands),
        out,
    )
    return out


def models_output(configuration: Configuration, commands: Array, measured: Array) -> Array:
    """What the models of a test asked for, shape (ticks, 4), columns of controllers.Commands: its
    commands, but for the plate's before a compensator of its delay.

    commands: those of the test; measured: what its controller read, columns of
    controllers.Measurements.
    """
    settings = configuration.controller
    if settings.plate_compensator == PlateCompensator.NONE or settings.mode == Mode.IMPOSED:
        return commands
    plain = settings._replace(plate_compensator=PlateCompensator.NONE)
    demands = [commands[:, Commands._fields.index(name)] for name in Demand._fields]
    replayed = RigControl().replay(plain, [*measured.T, *demands], configuration.timing.period)
    return replayed.T


def wing(settings: Settings, period: float, packed_states: Array) -> Array:
    """Of the cross of beams.

    Height over its centre at 0, 1, 2 and 3 beams from it, m, shape
    (ticks, 4).
    """
    heights = packed_states[:, PLACES["modal"]] @ set_up(settings, period).modes.wing
    return heights - heights[:, :1]


def recorded_wing(recording: Recording) -> Array | None:
    """The same of a recording, or None if its structure model was not of beams."""
    settings = override(Configuration(), {"controller": recording.controller}).controller
    if settings.structure != Structure.BEAM:
        return None
    measured = np.column_stack([recording.column("/sensor", name) for name in Measurements._fields])
    demands = np.column_stack([recording.column("/command", name) for name in Demand._fields])
    return wing(settings, recording.period, states(settings, recording.period, measured, demands))
