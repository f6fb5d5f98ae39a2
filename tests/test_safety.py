"""Limits: each trips on its own, at its value, by its name; what passes is remembered."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controllers import Commands, Measurements
from rigtwin.description.settings import Safety
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.safety import (
    empty_memory,
    empty_memory_arrays,
    find_arming_obstacle,
    judge_limits,
)
from rigtwin.simulation.trip import Trip, explain_trip

PERIOD = 1e-3
REST = Measurements(0.0, -0.004, 0.0, 200.0)
STILL = Commands(0.0, -0.004, 200.0, 1.07)
AT = {
    name: column
    for column, name in enumerate(
        (*Measurements._fields, *(f"command {c}" for c in Commands._fields))
    )
}


def verdict(
    measured: Measurements, commands: Commands, limits: Safety | None = None
) -> tuple[Trip, int]:
    """Of a tick that comes first, so that nothing can have jumped."""
    trip, column = judge_limits(limits or Safety(), PERIOD, empty_memory(), measured, commands)
    return Trip(trip), column


@pytest.mark.parametrize(
    ("measured", "commands", "trip", "where"),
    [
        (REST._replace(structure_lvdt=0.151), STILL, Trip.STRUCTURE, "structure_lvdt"),
        (REST._replace(structure_lvdt=-0.151), STILL, Trip.STRUCTURE, "structure_lvdt"),
        (REST._replace(load_cell=1501.0), STILL, Trip.FORCE, "load_cell"),
        (REST._replace(suspension_lvdt=-0.22), STILL, Trip.TRAVEL, "suspension_lvdt"),
        (REST._replace(ground_lvdt=0.26), STILL, Trip.GROUND, "ground_lvdt"),
        (REST._replace(load_cell=math.nan), STILL, Trip.NOT_A_NUMBER, "load_cell"),
        (REST._replace(ground_lvdt=math.inf), STILL, Trip.NOT_A_NUMBER, "ground_lvdt"),
        (REST, STILL._replace(voltage=math.nan), Trip.NOT_A_NUMBER, "command voltage"),
        (
            REST._replace(ground_lvdt=0.249),
            STILL._replace(ground=0.3751),
            Trip.COMMAND,
            "command ground",
        ),
        (REST._replace(structure_lvdt=-0.07), STILL, Trip.FOLLOWING, "structure_lvdt"),
        (REST._replace(ground_lvdt=0.07), STILL, Trip.FOLLOWING, "ground_lvdt"),
        (REST._replace(load_cell=601.0), STILL, Trip.FOLLOWING, "load_cell"),
        (
            Measurements(0.0, 0.149, 0.2, -1499.0),
            Commands(0.0, 0.149, -1499.0, 0.0),
            Trip.NONE,
            "ground_lvdt",
        ),
    ],
)
def test_each_limit(measured, commands, trip, where):
    assert verdict(measured, commands) == (trip, AT[where])


@pytest.mark.parametrize(
    ("measured", "commands", "trip", "where"),
    [
        (REST._replace(suspension_lvdt=0.0021), STILL, Trip.JUMP, "suspension_lvdt"),
        (REST._replace(load_cell=501.0), STILL._replace(force=501.0), Trip.JUMP, "load_cell"),
        (REST, STILL._replace(structure=-0.0061), Trip.COMMAND_RATE, "command structure"),
        (REST, STILL._replace(voltage=-1.5), Trip.COMMAND_RATE, "command voltage"),
        (
            REST._replace(suspension_lvdt=0.0019),
            STILL._replace(voltage=3.5),
            Trip.NONE,
            "ground_lvdt",
        ),
    ],
)
def test_limits_on_what_a_tick_may_change(measured, commands, trip, where):
    watch = empty_memory()
    assert judge_limits(Safety(), PERIOD, watch, REST, STILL)[0] == Trip.NONE
    assert judge_limits(Safety(), PERIOD, watch, measured, commands) == (trip, AT[where])


def test_travel_that_is_too_fast():
    watch = empty_memory()
    limits = Safety(velocity=1.5)
    trips = [
        judge_limits(limits, PERIOD, watch, REST._replace(suspension_lvdt=1.6e-3 * tick), STILL)[0]
        for tick in range(40)
    ]
    assert trips.index(Trip.VELOCITY) == 10


def test_stuck_sensor_is_seen_at_the_last_of_the_readings_allowed():
    watch, limits = empty_memory(), Safety(stuck=7.0)
    noise = np.random.default_rng(0).normal(0.0, 1e-5, (30, 4))
    trips, last = [], REST
    for tick in range(30):
        measured = Measurements(
            *(value + error for value, error in zip(REST, noise[tick], strict=True))
        )
        if tick >= 11:
            measured = measured._replace(suspension_lvdt=last.suspension_lvdt)
        last = measured
        trips.append(judge_limits(limits, PERIOD, watch, measured, STILL))
    assert trips.index((Trip.STUCK, AT["suspension_lvdt"])) == 16


@kernel
def _compiled(limits, watch, measured, commands):
    return judge_limits(limits, 1e-3, watch, measured, commands)


def test_compiled_is_the_same():
    random = np.random.default_rng(1)
    one, other = empty_memory(), empty_memory_arrays()
    limits = Safety(stuck=5.0, lvdt_rate=20.0, force_rate=2e6)
    seen = set()
    for _ in range(3000):
        measured = Measurements(*(random.normal(0.0, 1.0, 4) * [0.01, 0.01, 0.01, 700.0]).tolist())
        commands = Commands(*(random.normal(0.0, 1.0, 4) * [0.002, 0.002, 700.0, 3.0]).tolist())
        verdicts = (
            judge_limits(limits, PERIOD, one, measured, commands),
            _compiled(limits, other, measured, commands),
        )
        assert verdicts[0] == verdicts[1]
        seen.add(verdicts[0][0])
    assert len(seen) > 3


@pytest.mark.parametrize("trip", Trip)
def test_every_trip_is_explained_with_its_place(trip):
    for column in range(8):
        line = explain_trip(trip, Safety(stuck=7.0), column)
        assert line
        assert "\n" not in line


def test_arming_needs_every_signal_back_inside_by_the_hysteresis():
    assert find_arming_obstacle(Safety(), REST) is None
    refused = find_arming_obstacle(Safety(), REST._replace(structure_lvdt=0.14))
    assert refused is not None
    assert "structure_lvdt" in refused
    assert "0.135" in refused
    assert find_arming_obstacle(Safety(hysteresis=0.0), REST._replace(structure_lvdt=0.14)) is None
    assert "load_cell" in (find_arming_obstacle(Safety(), REST._replace(load_cell=math.nan)) or "")
