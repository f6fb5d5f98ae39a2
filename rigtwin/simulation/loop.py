"""Control loop: read → update → write, tick by tick, until the test ends or a limit trips.

`run` drives any rig through its four verbs. `compiled_loop.run_compiled` drives a twin without
leaving compiled code. Both give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from controllers import (
    Commands,
    Demand,
    Measurements,
    initial_state,
    update,
)
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.rig import Rig
from rigtwin.simulation.safety import LimitMemory, empty_memory, judge_limits
from rigtwin.simulation.trip import Trip
from rigtwin.simulation.twin import Twin

BLOCK = 250
"""Ticks in a block. At most a quarter of a second is not yet in the recording."""


@dataclass(frozen=True)
class Block:
    """Consecutive ticks of a test.

    Attributes
    ----------
    first : int
        Number of the first tick.
    commands, measurements : Array
        Columns of `Commands` and `Measurements`, shape (ticks, 4).
    truth : Array or None
        Readings of ideal sensors, shape (ticks, 4); None for a rig that does not know them.
    trip : Trip
        Limit that ended the test at the last tick, or Trip.NONE.
    column : int
        Column that tripped, of `Measurements`, or from 4 on of `Commands`.
    """

    first: int
    commands: Array
    measurements: Array
    truth: Array | None
    trip: Trip
    column: int = 0


Tick = Callable[[Measurements, Demand], Commands]
"""One tick of a controller: a function, or the bound method `tick` of an object."""


def check_commands(answer: object) -> Commands:
    """Return a controller's answer as commands that can be written to a rig.

    Parameters
    ----------
    answer
        Value that the controller returned.

    Returns
    -------
    Commands
        Four finite numbers.

    Raises
    ------
    RigtwinError
        If the answer is not four finite numbers.
    """
    try:
        commands = Commands(*(float(value) for value in answer))  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        commands = Commands(math.nan, math.nan, math.nan, math.nan)
    if not all(math.isfinite(value) for value in commands):
        names = ", ".join(Commands._fields)
        shown = " ".join(str(answer)[:200].split())[:80]
        raise RigtwinError(f"the controller gave {shown}; expected finite {names}")
    return commands


class TickController(Protocol):
    """Protocol of a user's controller: an object with one method."""

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """Return the commands of a tick from measurements and demands."""
        ...


class RigController:
    """Controller of the rig, tick by tick in Python."""

    def __init__(self, configuration: Configuration) -> None:
        self._controlling = set_up(configuration.controller, configuration.timing.period)
        self._state = initial_state(self._controlling)

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        self._state, commands = update(self._controlling, self._state, measured, demand)
        return commands


def run(
    rig: Rig, configuration: Configuration, demands: Array, tick: Tick | None = None
) -> Iterator[Block]:
    """Run a test tick by tick.

    Parameters
    ----------
    rig
        Twin, card or replay.
    configuration
        Settings of the test.
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).
    tick
        Controller of the user. Default: the rig's, with the configuration's settings.

    Yields
    ------
    Block
        Consecutive ticks; the last block says why the test ended.

    Raises
    ------
    RigtwinError
        If the user's controller returns anything but four finite commands.
    """
    foreign = tick is not None
    tick, limit_memory = tick or RigController(configuration).tick, empty_memory()
    rig.start()
    try:
        for first in range(0, len(demands), BLOCK):
            block, failure = _run_block(
                rig, configuration, demands[first : first + BLOCK], tick, foreign, limit_memory
            )
            # A failing controller must not lose the ticks before its failure.
            if len(block.commands):
                yield replace(block, first=first)
            if failure is not None:
                raise failure
            if block.trip != Trip.NONE:
                return
    finally:
        rig.stop()


def _run_block(
    rig: Rig,
    configuration: Configuration,
    demands: Array,
    tick: Tick,
    foreign: bool,
    limit_memory: LimitMemory,
) -> tuple[Block, Exception | None]:
    """Run the ticks of one block; return them and the error of the controller, if any."""
    rows: list[tuple[Commands, Measurements]] = []
    truth: list[Measurements] = []
    trip, column = Trip.NONE, 0
    failure: Exception | None = None
    for demand in demands:
        measured = rig.read()
        if isinstance(rig, Twin) and rig.misses(1)[0]:
            commands = rig.held
        else:
            try:
                commands = tick(measured, Demand(*demand.tolist()))
                commands = check_commands(commands) if foreign else commands
            except Exception as error:
                failure = error
                break
        if isinstance(rig, Twin):
            truth.append(rig.truth)
        rows.append((commands, measured))
        # Limits see a tick's commands before the rig does, so a bad command is never written.
        number, column = judge_limits(
            configuration.safety, configuration.timing.period, limit_memory, measured, commands
        )
        trip = Trip(number)
        if trip != Trip.NONE:
            break
        rig.write(commands)
    block = Block(
        0,
        np.array([commands for commands, _ in rows]),
        np.array([measured for _, measured in rows]),
        np.array(truth) if truth else None,
        trip,
        column,
    )
    return block, failure
