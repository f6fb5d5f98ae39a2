"""Motion of the structure model during a test: the controller is run again on the measurements."""

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
from rigtwin.recording import RecordedTest


@kernel
def _states(
    controlling: Controller, start: Array, plate: Array, measured: Array, demands: Array, out: Array
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
    """Return the controller's packed state after every tick.

    Parameters
    ----------
    settings
        Settings of the controller.
    period
        Time from tick to tick, s.
    measured
        Columns of `controllers.Measurements`, shape (ticks, 4).
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).

    Returns
    -------
    array
        Packed states, shape (ticks, SIZE).
    """
    # The controller is deterministic, so the recorded inputs reproduce its states.
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
    """Return the output of a test's models: its commands, before any delay compensator.

    Parameters
    ----------
    configuration
        Settings of the test.
    commands
        Commands of the test, columns of `controllers.Commands`, shape (ticks, 4).
    measured
        Readings of the controller, columns of `controllers.Measurements`, shape (ticks, 4).

    Returns
    -------
    array
        Columns of `controllers.Commands`, shape (ticks, 4).
    """
    settings = configuration.controller
    if settings.plate_compensator == PlateCompensator.NONE or settings.mode == Mode.IMPOSED:
        return commands
    plain = settings._replace(plate_compensator=PlateCompensator.NONE)
    demands = [commands[:, Commands._fields.index(name)] for name in Demand._fields]
    replayed = RigControl().replay(plain, [*measured.T, *demands], configuration.timing.period)
    return replayed.T


def wing(settings: Settings, period: float, packed_states: Array) -> Array:
    """Return the height of the cross of beams over its centre, m, shape (ticks, 4).

    The columns are 0, 1, 2 and 3 beams away from the centre.
    """
    heights = packed_states[:, PLACES["modal"]] @ set_up(settings, period).modes.wing
    return heights - heights[:, :1]


def recorded_wing(recording: RecordedTest) -> Array | None:
    """Return `wing` of a recording, or None if its structure model was not a cross of beams."""
    settings = override(Configuration(), {"controller": recording.controller}).controller
    if settings.structure != Structure.BEAM:
        return None
    measured = np.column_stack([recording.column("/sensor", name) for name in Measurements._fields])
    demands = np.column_stack([recording.column("/command", name) for name in Demand._fields])
    return wing(settings, recording.period, states(settings, recording.period, measured, demands))
