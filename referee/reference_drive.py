"""The rig's controller on the referee's plant: tests on a rig that differs from the twin."""

from __future__ import annotations

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    Measurements,
    controller,
    initial_state,
    packed,
    unpacked,
    update,
)
from referee.reference_plant import ReferenceBody, advance, at_rest, sample, true_values
from referee.reference_rig import draw_noise
from referee.reference_truth import Truth
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Safety
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.runner import SimulationResult
from rigtwin.simulation.safety import LimitMemory, empty_memory_arrays, judge_limits
from rigtwin.simulation.trip import Trip


@kernel
def _ticks(
    truth: Truth,
    body: ReferenceBody,
    controlling: Controller,
    limits: Safety,
    watch: LimitMemory,
    memory: Array,
    plate: Array,
    demands: Array,
    noise: Array,
    missed: Array,
    held: Array,
    commands_out: Array,
    sensors_out: Array,
    truth_out: Array,
) -> tuple[int, int]:
    """Run a test in place; return the completed ticks and the number of a `Trip`."""
    # Compiled code takes tuples of fixed size, so the packed state travels as an array.
    state = unpacked(to_fixed_tuple(memory, SIZE), plate)  # type: ignore[call-arg]
    for tick in range(len(demands)):
        values = true_values(body)
        sample(truth, body, tick, noise[tick], sensors_out[tick])
        row = sensors_out[tick]
        measured = Measurements(row[0], row[1], row[2], row[3])
        # A missed tick keeps the commands of the tick before.
        if missed[tick] == 0.0:
            state, commands = update(
                controlling,
                state,
                measured,
                Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2]),
            )
            for signal in range(4):
                held[signal] = commands[signal]
        for signal in range(4):
            commands_out[tick, signal] = held[signal]
            truth_out[tick, signal] = values[signal]
        trip, _ = judge_limits(
            limits,
            controlling.period,
            watch,
            measured,
            Commands(held[0], held[1], held[2], held[3]),
        )
        if trip != Trip.NONE.value:
            return tick + 1, trip
        advance(truth, body, held, tick * controlling.period)
    return len(demands), Trip.NONE.value


def drive(
    truth: Truth, configuration: Configuration, demands: Array, seed: int
) -> SimulationResult:
    """Run a test on the referee's plant with the rig's controller and limits.

    Parameters
    ----------
    truth : Truth
        Plant.
    configuration : Configuration
        Settings of controller, limits and timing. Its plant is ignored.
    demands : ndarray
        Ground, m, structure, m, and force, N, shape (ticks, 3).
    seed : int
        Seed of noise and missed ticks.

    Returns
    -------
    SimulationResult
        Result up to the end or the trip.
    """
    settings, ticks = configuration.controller, len(demands)
    controlling = controller(settings, configuration.timing.period)
    start = initial_state(controlling)
    body = at_rest(truth, float(demands[0, 0]), settings.start, settings.preload)
    noise, missed = draw_noise(truth, ticks, np.random.default_rng([seed, 5]))
    commands, sensors, true = (np.empty((ticks, 4)) for _ in range(3))
    held = np.array([demands[0, 0], settings.start, settings.preload, settings.preload / 186.0])
    completed, number = _ticks(
        truth=truth,
        body=body,
        controlling=controlling,
        limits=configuration.safety,
        watch=empty_memory_arrays(),
        memory=np.array(packed(start)),
        plate=start.plate,
        demands=np.ascontiguousarray(demands),
        noise=noise,
        missed=missed,
        held=held,
        commands_out=commands,
        sensors_out=sensors,
        truth_out=true,
    )
    return SimulationResult(
        commands[:completed], sensors[:completed], true[:completed], Trip(number)
    )
