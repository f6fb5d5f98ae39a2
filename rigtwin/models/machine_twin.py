"""Runs a test on the twin of a described machine, into a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rigtwin import __version__
from rigtwin.components import measures
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.control import FormulaControl
from rigtwin.description.effects import apply_effects
from rigtwin.description.limits import Tripped, find_trip
from rigtwin.description.machine import OWN, Machine, ReplayOf, Structure
from rigtwin.errors import RigtwinError
from rigtwin.models.commanding import Command, Tick, command_by_formula, command_by_function
from rigtwin.models.coupled_twin import move_commanded, move_freely
from rigtwin.models.demands import Columns, check_demands, list_sensed, list_wanted
from rigtwin.models.moved_twin import move_together
from rigtwin.models.mujoco import MujocoModel
from rigtwin.numerics.arrays import Array, runs_away
from rigtwin.recording import Recording, Writer
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
    with Writer(path, experiment, period, told, machine.name, fields) as writer:
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
) -> tuple[Columns, Tripped | None]:
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
    wanted, outputs = list_wanted(machine, demands, controller)
    columns = check_demands(machine, wanted, demands)
    signals = [signal for names in columns.values() for signal in names.values()]
    ticks = len(signals[0]) if signals else configuration.ticks
    random = np.random.default_rng([seed, 3])
    if machine.structure in TOGETHER:
        moving = [*machine.replays[0].free] or [machine.name]
        sound = _move(machine, configuration, columns, ticks, random, outputs, controller)
        away = [] if sound else moving
    else:
        away = [
            replay.joint.name
            for replay in machine.replays
            if not _simulate(
                machine=machine,
                replay=replay,
                configuration=configuration,
                columns=columns,
                ticks=ticks,
                random=random,
                controller=controller,
            )
        ]
    trip = find_trip(machine, configuration, columns)
    if away and trip is None:
        raise RunsAway(f"{machine.name}: {', '.join(away)}: runs away; nothing holds it")
    if trip is not None:
        columns = {
            topic: {name: signal[: trip.tick + 1] for name, signal in names.items()}
            for topic, names in columns.items()
        }
    return columns, trip


TOGETHER = {Structure.MOVED: move_together, Structure.COUPLED: move_freely}
"""Structure of joints that act on each other → what their sensors read in a test."""
BLOCK = 250
"""Ticks that are written at a time."""
FINISHED = "completed"


def _simulate(
    machine: Machine,
    replay: ReplayOf,
    configuration: Configuration,
    columns: Columns,
    ticks: int,
    random: np.random.Generator,
    controller: Tick | None,
) -> bool:
    """Adds what one joint does to the columns, and says whether it stayed within what a machine can
    do."""
    period, plant = configuration.timing.period, configuration.plant
    mover = machine.components[replay.moved_by[0]]
    assert mover.channel is not None
    output = (
        mover.channel[1]
        if mover.element == "actuator" and (replay.closed or controller is not None)
        else None
    )
    if output is not None:
        columns.setdefault("/command", {})[output] = np.zeros(ticks)
    sensors = [
        (name, component.channel)
        for name, component in machine.components.items()
        if component.element == "sensor"
        and component.joint == replay.joint.name
        and component.channel is not None
    ]
    made = {topic: dict(names) for topic, names in columns.items()}
    for _, (topic, name) in sensors:
        made.setdefault(topic, {}).setdefault(name, np.zeros(ticks))
    time = np.arange(ticks) * period
    told: dict[str, object] = {} if controller is None else {OWN: True}
    recording = Recording(
        path=Path("test"),
        machine=machine.name,
        experiment="",
        period=period,
        time=time,
        columns=made,
        controller=told,
    )
    model = MujocoModel(machine, replay, recording, configuration, configuration.substeps)
    model.sensor_noise = {name: _noise(plant, name, ticks, period, random) for name, _ in sensors}
    model.controller = controller
    if mover.element == "sensor":
        moved = model.prescribe(plant, columns[mover.channel[0]][mover.channel[1]])
    else:
        moved = model.move(plant)
    if output is not None:
        columns["/command"][output] = moved[3]
    for name, (topic, field) in sensors:
        if name in model.read:
            reading = model.read[name]
        else:
            row = ("position", "velocity", "force").index(measures(getattr(plant, name)))
            reading = (
                apply_sensor(getattr(plant, name), moved[row], period) + model.sensor_noise[name]
            )
            reading = _round(plant, name, reading)
        columns.setdefault(topic, {})[field] = reading
    return not runs_away(moved)


def _move(
    machine: Machine,
    configuration: Configuration,
    columns: Columns,
    ticks: int,
    random: np.random.Generator,
    outputs: Sequence[str],
    controller: Tick | None,
) -> bool:
    """Puts what the sensors of joints that act on each other read into the columns, and what a
    controller commands; says whether all stayed within what a machine can do."""
    plant, period = configuration.plant, configuration.timing.period
    channels = {
        name: component.channel
        for name, component in machine.components.items()
        if component.channel is not None
    }
    demands = {
        name: columns[channel[0]][channel[1]]
        for name, channel in channels.items()
        if name in machine.replays[0].moved_by and name not in outputs
    }
    if not outputs:
        found = TOGETHER[machine.structure](machine, configuration, demands)
        noise = {name: _noise(plant, name, ticks, period, random) for name in found.signals}
    else:
        sensors = [name for name in channels if measures(getattr(plant, name))]
        noise = {name: _noise(plant, name, ticks, period, random) for name in sensors}
        command = _command(machine, configuration, columns, controller)
        found = move_commanded(machine, configuration, demands, outputs, command, noise, ticks)
    for name, signal in found.signals.items():
        topic, field = channels[name]
        if name in found.whole:
            columns.setdefault(topic, {})[field] = signal
            continue
        columns.setdefault(topic, {})[field] = _round(plant, name, signal + noise[name])
    return found.sound


def _command(
    machine: Machine, configuration: Configuration, columns: Columns, controller: Tick | None
) -> Command:
    """What commands joints that act on each other."""
    if controller is not None:
        return command_by_function(controller, columns)
    control = machine.control
    assert isinstance(control, FormulaControl)
    read = list_sensed(machine)
    sensors = {c.channel: name for name, c in machine.components.items() if c.channel in read}
    settings = configuration.controller._asdict()
    return command_by_formula(control, settings, columns, sensors, configuration.timing.period)


def _round(plant: Plant, name: str, reading: Array) -> Array:
    """A reading to the sensor's bit."""
    bit = getattr(plant, name).resolution
    return np.round(reading / bit) * bit if bit > 0.0 else reading


def _noise(
    plant: Plant, name: str, ticks: int, period: float, random: np.random.Generator
) -> Array:
    sensor = getattr(plant, name)
    phase = random.uniform(0.0, 2.0 * np.pi)
    hum = sensor.hum * np.sin(
        2.0 * np.pi * plant.mains.frequency * period * np.arange(ticks) + phase
    )
    return sensor.white * random.standard_normal(ticks) + hum
