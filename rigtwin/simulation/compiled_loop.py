"""The control loop of the rig as one compiled function."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    initial_state,
    packed,
    unpacked,
    update,
)
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.description.settings import Safety
from rigtwin.interruptions import defer_sigint
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.converters import Sensing, sample_sensors
from rigtwin.simulation.loop import BLOCK, Block
from rigtwin.simulation.plant import PlantState, advance, sense
from rigtwin.simulation.safety import LimitMemory, empty_memory_arrays, judge_limits
from rigtwin.simulation.trip import Trip
from rigtwin.simulation.twin import Twin


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
    """Run ticks in compiled code; return their number, the number of a Trip and its column.

    The first tick may have been missed, hence `held`, the commands before it. `memory` and
    `plate_memory` hold the controller's packed state and are changed in place.
    """
    # Only plain numbers and arrays are returned: making any other Python object can run into a
    # pending Ctrl-C, which compiled code does not survive.
    state = unpacked(to_fixed_tuple(memory, SIZE), plate_memory)  # type: ignore[call-arg]
    done, trip, column = 0, Trip.NONE.value, 0
    for tick in range(len(demands)):
        true = sense(plant)
        measured = sample_sensors(sensing, true, disturbance[tick])
        demand = Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2])
        commands = held
        if not missed[tick]:
            state, commands = update(controlling, state, measured, demand)
        # A missed tick is recorded with the commands that stay in force.
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
    """Run a test on the twin in compiled code: the blocks of `run`, several times as fast.

    Parameters
    ----------
    twin
        Twin at its start.
    configuration
        Settings of the test.
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).
    block
        Ticks in a block.

    Yields
    ------
    Block
        Consecutive ticks; the last block says why the test ended.
    """
    controlling = set_up(configuration.controller, configuration.timing.period)
    start, limit_memory = initial_state(controlling), empty_memory_arrays()
    memory, plate_memory = np.array(packed(start)), start.plate
    for first in range(0, len(demands), block):
        asked = np.ascontiguousarray(demands[first : first + block], dtype=np.float64)
        commands, measured, truth = (np.empty((len(asked), 4)) for _ in range(3))
        # Ctrl-C is deferred while compiled code runs. The first block may have to be compiled
        # first, which takes seconds and must stay interruptible.
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
