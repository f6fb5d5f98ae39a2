"""Test on the twin of the suspension rig, into a recording or in memory."""

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
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.loop import BLOCK, Block, Tick, run
from rigtwin.simulation.trip import Trip, explain_trip
from rigtwin.simulation.twin import Twin

AT_ONCE = 10 * BLOCK
"""Ticks that compiled code runs in one call. A call costs as much as a hundred ticks."""


@dataclass(frozen=True)
class RunResult:
    """Result of a recorded test.

    Attributes
    ----------
    path : Path
        File of the recording.
    ticks : int
        Number of recorded ticks.
    reason : str
        Why the test ended, in one line.
    tripped : bool
        Whether a limit ended the test early.
    """

    path: Path
    ticks: int
    reason: str
    tripped: bool


@dataclass(frozen=True)
class SimulationResult:
    """Result of a test that was run in memory.

    Attributes
    ----------
    commands, measurements, truth : Array
        Commands, readings with noise and readings of ideal sensors, columns of `Commands` and
        `Measurements`, shape (ticks, 4).
    trip : Trip
        Limit that ended the test early, or Trip.NONE.
    """

    commands: Array
    measurements: Array
    truth: Array
    trip: Trip


def simulate(configuration: Configuration, demands: Array, seed: int) -> SimulationResult:
    """Run a test on the twin in memory.

    Parameters
    ----------
    configuration
        Settings of the test.
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).
    seed
        Seed of the sensors' noise.

    Returns
    -------
    SimulationResult
        Commands, measurements and truth at every tick, and the limit that tripped.
    """
    blocks = list(
        run_compiled(Twin(configuration, float(demands[0, 0]), seed), configuration, demands)
    )
    truth = np.concatenate([block.truth for block in blocks if block.truth is not None])
    commands = np.concatenate([block.commands for block in blocks])
    measured = np.concatenate([block.measurements for block in blocks])
    return SimulationResult(commands, measured, truth, blocks[-1].trip)


def without_limits(configuration: Configuration) -> Configuration:
    """Return a configuration with infinite limits, under which no test trips."""
    return configuration._replace(safety=Safety(*(math.inf for _ in Safety._fields)))


def _append_block(writer: Writer, block: Block) -> None:
    """Append the ticks of a block to a recording, a quarter of a second at a time."""
    for first in range(0, len(block.commands), BLOCK):
        part = slice(first, first + BLOCK)
        writer.append(
            command=block.commands[part],
            sensor=block.measurements[part],
            truth=None if block.truth is None else block.truth[part],
        )


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
    """Run a test on the twin of a quarter car into a new recording.

    A trip, an interruption or an exception leaves a readable recording that says why it ended.

    Parameters
    ----------
    path
        File of the recording.
    experiment
        Name of the test.
    configuration
        Settings as the operator knows them; they are stored in the recording.
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).
    seed
        Seed of the sensors' noise.
    progress
        Function that is called with the number of ticks since its last call.
    effects
        Hidden effects: simulated, but not stored in the recording's settings.
    effects_from
        Time from which the effects act, s, rounded up to a block of the recording.
    machine
        Name of the machine.
    controller
        Controller of the user, tick by tick in Python. Default: the rig's own. With it, the
        recording stores only the start and the preload of the controller's settings.
    description
        Description of the machine, stored in the recording; None for a shipped one.

    Returns
    -------
    RunResult
        Path, number of ticks and reason of the end.

    Raises
    ------
    RigtwinError
        If the configuration is invalid. Nothing is written then.
    """
    actual = apply_effects(configuration, list(effects))
    later, period = effects_from > 0.0, configuration.timing.period
    twin = Twin(configuration if later else actual, float(demands[0, 0]), seed)
    settings = flatten(configuration)
    controller_settings: dict[str, object] = dict(settings["controller"])
    if controller is None:
        # A refused test must not replace an existing recording, so check before writing.
        set_up(actual.controller, period)
        blocks = run_compiled(twin, actual, demands, BLOCK if later else AT_ONCE)
    else:
        known = {name: controller_settings[name] for name in ("start", "preload")}
        controller_settings = {OWN: True, **known}
        blocks = run(twin, actual, demands, controller)
    ticks, trip, column = 0, Trip.NONE, 0
    with Writer(
        path, experiment, period, controller_settings, machine, description=description
    ) as writer:
        writer.add_twin(seed, settings, tuple(effects), __version__, effects_from)
        for block in blocks:
            _append_block(writer, block)
            ticks, trip, column = ticks + len(block.commands), block.trip, block.column
            # The compiled loop ends with a block, so the effects can only begin at its end.
            if later and ticks * period >= effects_from - 1e-9:
                twin.change(actual)
                later = False
            progress(len(block.commands))
        reason = explain_trip(trip, configuration.safety, column)
        writer.finish(reason)
    return RunResult(path, ticks, reason, trip != Trip.NONE)
