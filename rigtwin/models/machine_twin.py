"""Test of a described machine's twin: simulate it and write the recording."""

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
from rigtwin.description.replay import ReplayOf
from rigtwin.errors import RigtwinError
from rigtwin.models.commanding import Command, Tick, command_by_formula, command_by_function
from rigtwin.models.demands import Columns, check_demands, list_movers, list_sensors, list_wanted
from rigtwin.models.forward_twin import list_parts, simulate_controlled, simulate_forward
from rigtwin.models.inverse_twin import SimulatedSignals, simulate_prescribed
from rigtwin.models.joint_twin import simulate_joint
from rigtwin.models.reading import make_noise, round_reading, sensors_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.simulation.runner import RunResult


class RunsAway(RigtwinError):
    """Error of a simulated motion that diverges without meeting a limit."""


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
    """Run a test on the twin of a described machine into a new recording.

    Parameters
    ----------
    path
        File of the recording.
    machine
        Description of the machine.
    experiment
        Name of the test.
    configuration
        Settings as the operator knows them; they are stored in the recording.
    demands
        Field, or topic.field, of each demanded channel → its values, shape (ticks,).
    seed
        Seed of the sensors' noise.
    effects
        Hidden effects: simulated, but not stored in the recording's settings.
    controller
        Controller of the user. Default: the described one.

    Returns
    -------
    RunResult
        Path, number of ticks and reason of the end.

    Raises
    ------
    RigtwinError
        If a demand is missing or not a number, or an effect is unknown. Nothing is written then.
    """
    # Simulate first: a test that is refused must not touch an existing recording.
    actual = apply_effects(configuration, effects)
    columns, trip = simulate_machine(machine, actual, demands, seed, controller)
    ticks = next(len(signal) for names in columns.values() for signal in names.values())
    settings = flatten(configuration)
    controller_values = settings.get("controller", {}) if controller is None else {OWN: True}
    fields = {topic: tuple(names) for topic, names in columns.items()}
    period = configuration.timing.period
    reason = FINISHED if trip is None else trip.reason
    described = own_description(machine)
    with Writer(
        path, experiment, period, controller_values, machine.name, fields, described
    ) as writer:
        writer.add_twin(seed, settings, tuple(effects), __version__)
        _write_columns(writer, columns, ticks)
        writer.finish(reason)
    return RunResult(path, ticks, reason, trip is not None)


def _write_columns(writer: Writer, columns: Columns, ticks: int) -> None:
    """Write all signals of a test in blocks of ticks."""
    tables = {
        topic.strip("/"): np.column_stack(list(names.values())) for topic, names in columns.items()
    }
    for first in range(0, ticks, BLOCK):
        writer.append(**{topic: table[first : first + BLOCK] for topic, table in tables.items()})


def simulate_machine(
    machine: Machine,
    configuration: Configuration,
    demands: Mapping[str, Array],
    seed: int,
    controller: Tick | None = None,
) -> tuple[Columns, LimitTrip | None]:
    """Simulate a test of a described machine in memory.

    Parameters
    ----------
    machine
        Description of the machine.
    configuration
        Settings of the test, with the effects applied.
    demands, seed, controller
        Demands, seed of the noise and controller, as in `run_machine`.

    Returns
    -------
    tuple
        Topic → field → signal up to the end of the test, and the limit that ended it early, or
        None.

    Raises
    ------
    RigtwinError
        If a demand is missing or not a number, or the motion diverges without meeting a limit.
    """
    require_order(machine, configuration)
    wanted, outputs = list_wanted(machine, demands, controller)
    columns = check_demands(machine, wanted, demands)
    signals = [signal for names in columns.values() for signal in names.values()]
    ticks = len(signals[0]) if signals else configuration.ticks
    # The second number separates this stream of random numbers from others of the same seed.
    random = np.random.default_rng([seed, 3])
    plant, period = configuration.plant, configuration.timing.period
    noise = {name: make_noise(plant, name, ticks, period, random) for name in sensors_of(machine)}
    command: Command | None = None
    if controller is not None:
        command = command_by_function(controller, columns)
    elif outputs:
        command = command_of(machine, configuration, columns)
    diverged = _simulate_parts(machine, configuration, columns, outputs, command, noise, ticks)
    trip = find_trip(machine, configuration, columns)
    if diverged and trip is None:
        joints = ", ".join(diverged)
        raise RunsAway(f"{machine.name}: {joints}: diverged: no restoring force or limit")
    return columns if trip is None else _cut_columns(columns, trip.tick + 1), trip


def _simulate_parts(
    machine: Machine,
    configuration: Configuration,
    columns: Columns,
    outputs: Sequence[str],
    command: Command | None,
    noise: Mapping[str, Array],
    ticks: int,
) -> list[str]:
    """Simulate all parts of a machine one by one and add their readings to `columns`.

    Returns the names of the joints whose motion diverged.
    """
    demanded = {
        name: columns[channel[0]][channel[1]]
        for name, channel in list_movers(machine).items()
        if name not in outputs
    }
    diverged: list[str] = []
    for replay in list_parts(machine):
        part_demands = {name: demanded[name] for name in replay.moved_by if name in demanded}
        if replay.free and command is not None:
            part_outputs = [name for name in outputs if name in replay.moved_by]
            moved = simulate_controlled(
                machine, replay, configuration, part_demands, part_outputs, command, noise, ticks
            )
        else:
            moved = _simulate_open_loop(machine, replay, configuration, part_demands)
        if not moved.sound:
            diverged += replay.free or (machine.name,)
        for name, signal in moved.signals.items():
            channel = machine.components[name].channel
            assert channel is not None
            reading = signal
            # The readings of a controller have their noise already: it acted in the loop.
            if name not in moved.whole:
                reading = round_reading(configuration.plant, name, signal + noise[name])
            columns.setdefault(channel[0], {})[channel[1]] = reading
    return diverged


def _simulate_open_loop(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> SimulatedSignals:
    """Simulate one part of a machine whose commands are all known beforehand."""
    if replay.free:
        return simulate_forward(machine, replay, configuration, demands)
    if len(replay.moved_by) > 1:
        return simulate_prescribed(machine, configuration, demands)
    return simulate_joint(machine, replay, configuration, demands)


def _cut_columns(columns: Columns, ticks: int) -> Columns:
    """Return the first ticks of all signals."""
    return {
        topic: {name: signal[:ticks] for name, signal in names.items()}
        for topic, names in columns.items()
    }


BLOCK = 250
"""Number of ticks that are written at a time."""
FINISHED = "completed"


def command_of(machine: Machine, configuration: Configuration, columns: Columns) -> Command:
    """Return the described controller of a machine, for a loop that advances tick by tick.

    Parameters
    ----------
    machine
        Description of the machine.
    configuration
        Settings of the test, with those of the controller.
    columns
        Demands of the test: topic → field → signal, shape (ticks,).
    """
    control = machine.control
    assert isinstance(control, FormulaControl)
    read = {name: machine.components[name].channel for name in list_sensors(machine)}
    sensors = {channel: name for name, channel in read.items() if channel is not None}
    settings = configuration.controller._asdict()
    return command_by_formula(control, settings, columns, sensors, configuration.timing.period)
