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
from rigtwin.description.control import Channel
from rigtwin.description.effects import apply_effects
from rigtwin.description.machine import OWN, Machine, ReplayOf, Structure
from rigtwin.errors import RigtwinError
from rigtwin.models.coupled_twin import move_freely
from rigtwin.models.moved_twin import move_together
from rigtwin.models.mujoco import MujocoModel, Tick
from rigtwin.numerics.arrays import RUNAWAY, Array
from rigtwin.recording import Recording, Writer
from rigtwin.simulation.runner import RunResult

Columns = dict[str, dict[str, Array]]


def demanded_channels(machine: Machine) -> list[Channel]:
    """What a test has to demand of a machine.

    Parameters
    ----------
    machine
        Its description.

    Returns
    -------
    list of channels
        Commands that no described controller computes, what the controller is given besides its own
        sensors, and motions that are prescribed.
    """
    found: list[Channel] = []
    for replay in machine.replays:
        if machine.structure in TOGETHER:
            channels = [machine.components[name].channel for name in replay.moved_by]
            found += [channel for channel in channels if channel is not None]
            continue
        mover = machine.components[replay.moved_by[0]]
        own = {
            c.channel
            for c in machine.components.values()
            if c.joint == replay.joint.name and c.element == "sensor"
        }
        if replay.closed and machine.control is not None:
            found += [channel for channel in machine.control.channels if channel not in own]
        elif mover.channel is not None:
            found.append(mover.channel)
    return list(dict.fromkeys(found))


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
        That commands the machine's actuator instead of the described one.

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
    wanted = demanded_channels(machine)
    if controller is not None:
        # A controller of one's own takes whatever demands it knows.
        wanted = [("/command", name) for name in demands]
    columns = _check_demands(machine, wanted, demands)
    ticks = len(next(iter(next(iter(columns.values())).values())))
    random = np.random.default_rng([seed, 3])
    if machine.structure in TOGETHER:
        _move(machine, actual, columns, ticks, random)
    for replay in () if machine.structure in TOGETHER else machine.replays:
        _simulate(
            machine=machine,
            replay=replay,
            configuration=actual,
            columns=columns,
            ticks=ticks,
            random=random,
            controller=controller,
        )
    settings = flatten(configuration)
    told = settings.get("controller", {}) if controller is None else {OWN: True}
    fields = {topic: tuple(names) for topic, names in columns.items()}
    period = configuration.timing.period
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
        writer.finish(FINISHED)
    return RunResult(path, ticks, FINISHED, False)


TOGETHER = {Structure.MOVED: move_together, Structure.COUPLED: move_freely}
"""Structure of joints that act on each other → what their sensors read in a test."""
BLOCK = 250
"""Ticks that are written at a time."""
FINISHED = "completed"


def _check_demands(
    machine: Machine, wanted: Sequence[Channel], demands: Mapping[str, Array]
) -> Columns:
    columns: Columns = {}
    names = {f"{topic}.{name}" for topic, name in wanted} | {name for _, name in wanted}
    if unknown := [name for name in demands if name not in names]:
        there = ", ".join(name for _, name in wanted)
        raise RigtwinError(
            f"{machine.name}: nothing takes the demand {unknown[0]!r}; there are {there}"
        )
    lengths = set()
    for topic, name in wanted:
        given = demands.get(f"{topic}.{name}", demands.get(name))
        if given is None:
            there = ", ".join(name for _, name in wanted)
            raise RigtwinError(
                f"{machine.name}: no demand for {topic}.{name}; a test gives {there}"
            )
        values = np.asarray(given, float)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise RigtwinError(
                f"{machine.name}: demand {name}: expected finite numbers, one a tick"
            )
        lengths.add(len(values))
        columns.setdefault(topic, {})[name] = values
    if len(lengths) > 1:
        raise RigtwinError(
            f"{machine.name}: demands have {', '.join(map(str, sorted(lengths)))} "
            "ticks; expected one length"
        )
    return columns


def _simulate(
    machine: Machine,
    replay: ReplayOf,
    configuration: Configuration,
    columns: Columns,
    ticks: int,
    random: np.random.Generator,
    controller: Tick | None,
) -> None:
    """Adds what one joint does to the columns."""
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
    if not np.isfinite(moved).all() or np.max(np.abs(moved[:2])) >= RUNAWAY:
        raise RigtwinError(
            f"{machine.name}: joint {replay.joint.name} runs away; the loop is not stable"
        )
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


def _move(
    machine: Machine,
    configuration: Configuration,
    columns: Columns,
    ticks: int,
    random: np.random.Generator,
) -> None:
    """Puts what the sensors of joints that act on each other read into the columns."""
    plant, period = configuration.plant, configuration.timing.period
    channels = {
        name: component.channel
        for name, component in machine.components.items()
        if component.channel is not None
    }
    demands = {
        name: columns[channel[0]][channel[1]]
        for name, channel in channels.items()
        if name in machine.replays[0].moved_by
    }
    move = TOGETHER[machine.structure]
    for name, reading in move(machine, configuration, demands).items():
        topic, field = channels[name]
        noisy = reading + _noise(plant, name, ticks, period, random)
        columns.setdefault(topic, {})[field] = _round(plant, name, noisy)


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
