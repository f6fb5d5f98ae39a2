"""Runs one test on the twin, into a recording or in memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machines import DEFAULT_MACHINE
from rigtwin import __version__
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.control import set_up
from rigtwin.description.effects import apply_effects
from rigtwin.description.machine import OWN
from rigtwin.description.settings import Safety
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.simulation.loop import BLOCK, Tick, run, run_compiled
from rigtwin.simulation.safety import Trip, explain_trip
from rigtwin.simulation.twin import Twin

AT_ONCE = 10 * BLOCK
"""Ticks of a twin's test that compiled code does at once: to be called costs it as much as a
hundred ticks."""


@dataclass(frozen=True)
class RunResult:
    """How a test went. ticks: recorded; reason: one line; tripped: whether a limit ended it
    early."""

    path: Path
    ticks: int
    reason: str
    tripped: bool


@dataclass(frozen=True)
class SimulationResult:
    """A test run in memory. commands, measurements, truth: shape (ticks, 4), columns of
    controllers.Commands, .Measurements; trip: why it ended early, or Trip.NONE."""

    commands: Array
    measurements: Array
    truth: Array
    trip: Trip


def simulate(configuration: Configuration, demands: Array, seed: int) -> SimulationResult:
    """Runs a test on the twin and keeps everything in memory.

    Parameters
    ----------
    configuration
        Of the test.
    demands
        Columns of controllers.Demand, shape (ticks, 3).
    seed
        Of the sensors' noise.

    Returns
    -------
    SimulationResult
        Commands, measurements and truth at every tick, and why it ended.
    """
    blocks = list(
        run_compiled(Twin(configuration, float(demands[0, 0]), seed), configuration, demands)
    )
    truth = np.concatenate([block.truth for block in blocks if block.truth is not None])
    commands, measured = (
        np.concatenate([getattr(block, name) for block in blocks])
        for name in ("commands", "measurements")
    )
    return SimulationResult(commands, measured, truth, blocks[-1].trip)


def without_limits(configuration: Configuration) -> Configuration:
    """The same without trips, to see what a twin would do wherever it goes.

    Parameters
    ----------
    configuration
        Of a test.

    Returns
    -------
    Configuration
        With infinite limits.
    """
    return configuration._replace(safety=Safety(*(math.inf for _ in Safety._fields)))


def record(
    path: Path,
    experiment: str,
    configuration: Configuration,
    demands: Array,
    seed: int,
    progress: Callable[[int], object] = lambda _: None,
    effects: Sequence[str] = (),
    *,
    effects_from: float = 0.0,
    machine: str = DEFAULT_MACHINE,
    controller: Tick | None = None,
    description: Path | None = None,
) -> RunResult:
    """Runs a test on the twin of a quarter car into a new recording.

    A trip, an interruption or an exception leaves a readable recording that says why it ended.

    Parameters
    ----------
    path
        Of the recording.
    experiment
        The test's name.
    configuration
        What the operator knows.
    demands
        Columns of controllers.Demand, shape (ticks, 3).
    seed
        Of the sensors' noise.
    progress
        Called with the ticks done since its last call.
    effects
        As `--effect` takes them; the rig has them, the operator's settings do not know of them.
    effects_from
        s, from when on it has them, rounded up to a block of the recording.
    machine
        The machine's name.
    controller
        One of one's own instead of the rig's, tick by tick in Python; the recording then says
        nothing of a controller's settings but where the test started.
    description
        Description of the machine, which the recording remembers; None for a shipped one.

    Returns
    -------
    RunResult
        How it went.

    Raises
    ------
    RigtwinError
        Before anything is written, if the configuration is at fault.
    """
    actual = apply_effects(configuration, list(effects))
    later = effects_from > 0.0
    twin = Twin(configuration if later else actual, float(demands[0, 0]), seed)
    if controller is None:
        # Refused before the recording takes the place of another.
        set_up(actual.controller, actual.timing.period)
    settings = flatten(configuration)
    told: dict[str, object] = dict(settings["controller"])
    blocks = run_compiled(twin, actual, demands, BLOCK if later else AT_ONCE)
    if controller is not None:
        told = {OWN: True, **{name: told[name] for name in ("start", "preload")}}
        blocks = run(twin, actual, demands, controller)
    ticks, trip, column = 0, Trip.NONE, 0
    period = configuration.timing.period
    with Writer(path, experiment, period, told, machine, description=description) as writer:
        writer.add_twin(seed, settings, tuple(effects), __version__, effects_from)
        for block in blocks:
            for first in range(0, len(block.commands), BLOCK):
                part = slice(first, first + BLOCK)
                writer.append(
                    command=block.commands[part],
                    sensor=block.measurements[part],
                    truth=None if block.truth is None else block.truth[part],
                )
            ticks, trip, column = ticks + len(block.commands), block.trip, block.column
            if later and ticks * configuration.timing.period >= effects_from - 1e-9:
                twin.change(actual)
                later = False
            progress(len(block.commands))
        reason = explain_trip(trip, configuration.safety, column)
        writer.finish(reason)
    return RunResult(path, ticks, reason, trip != Trip.NONE)
