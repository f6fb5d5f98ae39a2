"""The control loop: read → update → write, tick by tick, until the test is over or a limit trips.

`run` drives any rig through its four verbs. `run_compiled` does the same to a twin without leaving
compiled code; both give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    Measurements,
    initial_state,
    packed,
    unpacked,
    update,
)
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.description.settings import Safety
from rigtwin.errors import RigtwinError
from rigtwin.interruptions import defer_sigint
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.converters import Sensing, sample_sensors
from rigtwin.simulation.plant import PlantState, advance, sense
from rigtwin.simulation.rig import Rig
from rigtwin.simulation.safety import (
    LimitMemory,
    Trip,
    empty_memory,
    empty_memory_arrays,
    judge_limits,
)
from rigtwin.simulation.twin import Twin

BLOCK = 250
"""Ticks handed on at a time, so what is not yet in a recording is at most a quarter of a second."""


@dataclass(frozen=True)
class Block:
    """Some consecutive ticks. first: number of the first; commands, measurements, truth: shape
    (ticks, 4), truth None for a rig that does not know it; trip: why the test ends with this
    block's last tick, or Trip.NONE; column: that tripped, of Measurements or, from 4 on, of
    Commands."""

    first: int
    commands: Array
    measurements: Array
    truth: Array | None
    trip: Trip
    column: int = 0


Tick = Callable[[Measurements, Demand], Commands]
"""One tick of a controller: a function, or the bound method `tick` of an object."""


def check_commands(given: object) -> Commands:
    """Commands that can be written to a rig.

    Parameters
    ----------
    given
        What a controller returned.

    Returns
    -------
    Commands
        Four finite numbers.

    Raises
    ------
    RigtwinError
        For anything else.
    """
    try:
        commands = Commands(*(float(value) for value in given))  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        commands = Commands(math.nan, math.nan, math.nan, math.nan)
    if not all(math.isfinite(value) for value in commands):
        names = ", ".join(Commands._fields)
        shown = " ".join(str(given)[:200].split())[:80]
        raise RigtwinError(f"the controller gave {shown}; expected finite {names}")
    return commands


class TickController(Protocol):
    """A controller of one's own: an object with one method."""

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """The commands of a tick for what was measured and what the test demands."""
        ...


class RigController:
    """The controller of the rig, tick by tick in Python."""

    def __init__(self, configuration: Configuration) -> None:
        self._controlling = set_up(configuration.controller, configuration.timing.period)
        self._state = initial_state(self._controlling)

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        self._state, commands = update(self._controlling, self._state, measured, demand)
        return commands


def run(
    rig: Rig, configuration: Configuration, demands: Array, tick: Tick | None = None
) -> Iterator[Block]:
    """Runs a test tick by tick.

    Parameters
    ----------
    rig
        Twin, card or replay.
    configuration
        Of the test.
    demands
        Columns of controllers.Demand, shape (ticks, 3).
    tick
        A controller of one's own; by default the rig's with the configuration's settings.

    Yields
    ------
    Block
        Consecutive ticks; the last says why the test ended.

    Raises
    ------
    RigtwinError
        If a controller of one's own gives anything but four finite commands.
    """
    own = tick is not None
    tick, limit_memory = tick or RigController(configuration).tick, empty_memory()
    rig.start()
    try:
        for first in range(0, len(demands), BLOCK):
            rows: list[tuple[Commands, Measurements]] = []
            truth: list[Measurements] = []
            trip, column = Trip.NONE, 0
            failure: Exception | None = None
            for demand in demands[first : first + BLOCK]:
                measured = rig.read()
                if isinstance(rig, Twin) and rig.misses(1)[0]:
                    commands = rig.held
                else:
                    try:
                        commands = tick(measured, Demand(*demand.tolist()))
                        commands = check_commands(commands) if own else commands
                    except Exception as error:
                        # What was recorded before is handed on first.
                        failure = error
                        break
                if isinstance(rig, Twin):
                    truth.append(rig.truth)
                rows.append((commands, measured))
                number, column = judge_limits(
                    configuration.safety,
                    configuration.timing.period,
                    limit_memory,
                    measured,
                    commands,
                )
                trip = Trip(number)
                if trip != Trip.NONE:
                    break
                rig.write(commands)
            if rows:
                yield Block(
                    first,
                    np.array([commands for commands, _ in rows]),
                    np.array([measured for _, measured in rows]),
                    np.array(truth) if truth else None,
                    trip,
                    column,
                )
            if failure is not None:
                raise failure
            if trip != Trip.NONE:
                return
    finally:
        rig.stop()


@kernel
def _ticks(
    plant: PlantState,
    controlling: Controller,
    limits: Safety,
    limit_memory: LimitMemory,
    sensing: Sensing,
    memory: Array,
    plate_memory: Array,
    held: Commands,
    demands: Array,
    missed: NDArray[np.bool_],
    disturbance: Array,
    commands_out: Array,
    measured_out: Array,
    truth_out: Array,
) -> tuple[int, int, int]:
    """Ticks done, the number of a Trip and the column. Gives back plain numbers and arrays only:
    making any other Python object can run into a pending Ctrl-C, which compiled code does not
    survive."""
    state = unpacked(to_fixed_tuple(memory, SIZE), plate_memory)  # type: ignore[call-arg]
    done, trip, column = 0, Trip.NONE.value, 0
    for tick in range(len(demands)):
        true = sense(plant)
        measured = sample_sensors(sensing, true, disturbance[tick])
        demand = Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2])
        commands = held
        if not missed[tick]:
            state, commands = update(controlling, state, measured, demand)
        for signal in range(4):
            commands_out[tick, signal] = commands[signal]
            measured_out[tick, signal] = measured[signal]
            truth_out[tick, signal] = true[signal]
        done = tick + 1
        trip, column = judge_limits(limits, controlling.period, limit_memory, measured, commands)
        if trip != Trip.NONE.value:
            break
        advance(plant, commands.ground, commands.structure, commands.voltage)
        held = commands
    numbers = packed(state)
    for number in range(SIZE):
        memory[number] = numbers[number]
    plate_memory[:] = state.plate
    return done, trip, column


def run_compiled(
    twin: Twin, configuration: Configuration, demands: Array, block: int = BLOCK
) -> Iterator[Block]:
    """Runs a test on the twin in compiled code; the same blocks as `run`, several times as fast.

    Parameters
    ----------
    twin
        At its start.
    configuration
        Of the test.
    demands
        Columns of controllers.Demand, shape (ticks, 3).
    block
        Ticks handed on at a time.

    Yields
    ------
    Block
        Consecutive ticks; the last says why the test ended.
    """
    controlling = set_up(configuration.controller, configuration.timing.period)
    start, limit_memory = initial_state(controlling), empty_memory_arrays()
    memory, plate_memory = np.array(packed(start)), start.plate
    for first in range(0, len(demands), block):
        asked = np.ascontiguousarray(demands[first : first + block], dtype=np.float64)
        commands, measured, truth = (np.empty((len(asked), 4)) for _ in range(3))
        # The first may have to be compiled, which can be interrupted.
        with defer_sigint() if first > 0 else nullcontext():
            done, number, column = _ticks(
                plant=twin.simulation.state,
                controlling=controlling,
                limits=configuration.safety,
                limit_memory=limit_memory,
                sensing=twin.sensing,
                memory=memory,
                plate_memory=plate_memory,
                held=twin.held,
                demands=asked,
                missed=twin.misses(len(asked)),
                disturbance=twin.disturbance.take(len(asked)),
                commands_out=commands,
                measured_out=measured,
                truth_out=truth,
            )
        trip = Trip(number)
        yield Block(first, commands[:done], measured[:done], truth[:done], trip, column)
        if trip != Trip.NONE:
            return
        twin.held = Commands(*commands[-1].tolist())
