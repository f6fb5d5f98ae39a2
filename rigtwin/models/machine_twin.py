"""Runs a test on the twin of a described machine, into a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rigtwin import __version__
from rigtwin.description.catalogue import own_description
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.control import FormulaControl
from rigtwin.description.effects import apply_effects
from rigtwin.description.limits import LimitTrip, find_trip, require_order
from rigtwin.description.machine import OWN, Machine
from rigtwin.errors import RigtwinError
from rigtwin.models.carried_twin import carry
from rigtwin.models.commanding import Command, Tick, command_by_formula, command_by_function
from rigtwin.models.coupled_twin import list_parts, move_commanded, move_freely
from rigtwin.models.demands import (
    Columns,
    check_demands,
    list_movers,
    list_sensors,
    list_wanted,
)
from rigtwin.models.moved_twin import move_together
from rigtwin.models.reading import make_noise, round_reading, sensors_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.simulation.runner import RunResult


class RunsAway(RigtwinError):
    """A machine that went where nothing can, and met no limit on its way."""


def run_machine(
    path: Path,
    machine: Machine,
    experiment: str,
    configuration: Configuration,
    demands: Mapping[str, Array],
    seed: int,
    *,
    effects: Sequence[str] = (),
    controller: Tick | None = None,
) -> RunResult:
    """Runs a test on the twin of a described machine into a new recording.

    Parameters
    ----------
    path
        Of the recording.
    machine
        Its description.
    experiment
        The test's name.
    configuration
        What the operator knows.
    demands
        Field, or topic.field, of each demanded channel → its values, shape (ticks,).
    seed
        Of the sensors' noise.
    effects
        That the machine has and the operator does not know of, as `--effect` takes them.
    controller
        That commands the machine's actuators instead of the described one.

    Returns
    -------
    RunResult
        How it went.

    Raises
    ------
    RigtwinError
        Before anything is written, if a demand is missing or not a number, or an effect is unknown.
    """
    actual = apply_effects(configuration, effects)
    columns, trip = simulate_machine(machine, actual, demands, seed, controller)
    ticks = next(len(signal) for names in columns.values() for signal in names.values())
    settings = flatten(configuration)
    told = settings.get("controller", {}) if controller is None else {OWN: True}
    fields = {topic: tuple(names) for topic, names in columns.items()}
    period = configuration.timing.period
    reason = FINISHED if trip is None else trip.reason
    described = own_description(machine)
    with Writer(path, experiment, period, told, machine.name, fields, described) as writer:
        writer.add_twin(seed, settings, tuple(effects), __version__)
        tables = {
            topic.strip("/"): np.column_stack(list(names.values()))
            for topic, names in columns.items()
        }
        for first in range(0, ticks, BLOCK):
            writer.append(
                **{topic: table[first : first + BLOCK] for topic, table in tables.items()}
            )
        writer.finish(reason)
    return RunResult(path, ticks, reason, trip is not None)


def simulate_machine(
    machine: Machine,
    configuration: Configuration,
    demands: Mapping[str, Array],
    seed: int,
    controller: Tick | None = None,
) -> tuple[Columns, LimitTrip | None]:
    """Runs a test on the twin of a described machine in memory.

    Parameters
    ----------
    machine
        Its description.
    configuration
        What it is, effects included.
    demands, seed, controller
        As of `run_machine`.

    Returns
    -------
    tuple
        Topic → field → signal, until the test was over, and which of its limits ended it early, if
        one did.

    Raises
    ------
    RigtwinError
        If a demand is missing or not a number, or the machine runs away without meeting a limit.
    """
    require_order(machine, configuration)
    wanted, outputs = list_wanted(machine, demands, controller)
    columns = check_demands(machine, wanted, demands)
    signals = [signal for names in columns.values() for signal in names.values()]
    ticks = len(signals[0]) if signals else configuration.ticks
    random = np.random.default_rng([seed, 3])
    plant, period = configuration.plant, configuration.timing.period
    noise = {name: make_noise(plant, name, ticks, period, random) for name in sensors_of(machine)}
    movers = list_movers(machine)
    given = {
        name: columns[channel[0]][channel[1]]
        for name, channel in movers.items()
        if name not in outputs
    }
    command: Command | None = None
    if controller is not None:
        command = command_by_function(controller, columns)
    elif outputs:
        command = command_of(machine, configuration, columns)
    away: list[str] = []
    for replay in list_parts(machine):
        mine = {name: given[name] for name in replay.moved_by if name in given}
        if replay.free and command is not None:
            own = [name for name in outputs if name in replay.moved_by]
            moved = move_commanded(machine, replay, configuration, mine, own, command, noise, ticks)
        elif replay.free:
            moved = move_freely(machine, replay, configuration, mine)
        elif len(replay.moved_by) > 1:
            moved = move_together(machine, configuration, mine)
        else:
            moved = carry(machine, replay, configuration, mine)
        if not moved.sound:
            away += replay.free or (machine.name,)
        for name, signal in moved.signals.items():
            channel = machine.components[name].channel
            assert channel is not None
            whole = name in moved.whole
            reading = signal if whole else round_reading(plant, name, signal + noise[name])
            columns.setdefault(channel[0], {})[channel[1]] = reading
    trip = find_trip(machine, configuration, columns)
    if away and trip is None:
        raise RunsAway(f"{machine.name}: {', '.join(away)}: runs away; nothing holds it")
    if trip is not None:
        columns = {
            topic: {name: signal[: trip.tick + 1] for name, signal in names.items()}
            for topic, names in columns.items()
        }
    return columns, trip


BLOCK = 250
"""Ticks that are written at a time."""
FINISHED = "completed"


def command_of(machine: Machine, configuration: Configuration, columns: Columns) -> Command:
    """The described controller of a machine. columns: what is demanded, topic → field → signal,
    shape (ticks,)."""
    control = machine.control
    assert isinstance(control, FormulaControl)
    read = {name: machine.components[name].channel for name in list_sensors(machine)}
    sensors = {channel: name for name, channel in read.items() if channel is not None}
    settings = configuration.controller._asdict()
    return command_by_formula(control, settings, columns, sensors, configuration.timing.period)
