"""The twin of joints that act on each other, some of them free: what their sensors read in a
test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.components import UNLIMITED, ForceActuator, measures
from rigtwin.components.conditioning import ActuatorState, actuator, condition, hold
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine, Row
from rigtwin.models.commanding import Command, Readings, commands_of
from rigtwin.models.coupled import CoupledModel, begin
from rigtwin.models.coupled_motion import Inputs, advance
from rigtwin.models.demanded import pose_as_recorded
from rigtwin.models.moved_twin import Moved
from rigtwin.numerics.arrays import Array, runs_away


class CoupledTwin(CoupledModel):
    """All joints in a test to come, advanced tick by tick under a controller."""

    def move_commanded(
        self,
        plant: Plant,
        outputs: Sequence[str],
        command: Command,
        readings: Readings,
        sensors: Sequence[Row],
    ) -> tuple[Array, Array]:
        """The motion and the commands.

        Parameters
        ----------
        plant
            Its components.
        outputs
            Force actuators and servos that the controller commands.
        command
            Of a tick, by what was read.
        readings, sensors
            What the controller reads: of positions and velocities.

        Returns
        -------
        tuple
            Positions, velocities and forces, shape (3, coordinates, ticks), as `move` has them;
            commands, shape (outputs, ticks).
        """
        steps, h = self._steps, self._period / self._steps
        multibody = self._bodies_of(plant)
        inputs = self._inputs(plant, self._push(plant), self._condition(plant, self._servos))
        contacts = self._contacts(plant, inputs.pushes)
        state = begin(contacts, self._start_of(plant), inputs.prescribed, self._held, h)
        bodies = multibody.bodies(multibody.data(), self._turning(plant))
        drives = [actuator(getattr(plant, name), plant.computer, h) for name in outputs]
        acts = [self._acting(plant, name, inputs) for name in outputs]
        along = {row.name: self._along[row.name] for row in sensors}
        rates = {row.name: row.kind == "velocity" for row in sensors}
        fields = [self._field(name) for name in outputs]
        out = np.zeros((3, multibody.coordinates, self._ticks))
        given, states = np.zeros((len(outputs), self._ticks)), list[ActuatorState]()
        for tick in range(self._ticks):
            true = {
                name: float(way @ state.speed)
                if rates[name]
                else float(way @ state.place) + self._zero[name]
                for name, way in along.items()
            }
            told = commands_of(command(tick, readings.take(tick, true)), fields)
            given[:, tick] = told
            states = states or [hold(*each) for each in zip(drives, told, strict=True)]
            for value, drive, held, (signal, factor, limit) in zip(
                told, drives, states, acts, strict=True
            ):
                for step in range(tick * steps, (tick + 1) * steps):
                    pushed = factor * condition(drive, held, value)
                    signal[step] = min(max(pushed, -limit), limit)
            advance(
                bodies=bodies,
                contacts=contacts,
                free=self._free,
                held=self._held,
                state=state,
                inputs=inputs,
                h=h,
                steps=steps,
                first=tick,
                last=tick + 1,
                out=out,
            )
        return out, given

    def _acting(self, plant: Plant, name: str, inputs: Inputs) -> tuple[Array, float, float]:
        """Where an actuator's signal stands among the inputs, shape (steps,), what a command makes
        of it, and its limit."""
        if name in self._servos:
            return inputs.servos.commands[self._servos.index(name)], 1.0, UNLIMITED
        mover: ForceActuator = getattr(plant, name)
        return inputs.pushes[self._pushers.index(name)], mover.constant, self._limit(plant, name)

    def _field(self, name: str) -> str:
        channel = self._machine.components[name].channel
        return name if channel is None else channel[1]


def move_freely(machine: Machine, configuration: Configuration, demands: dict[str, Array]) -> Moved:
    """What the sensors read, noise and bits apart.

    Parameters
    ----------
    machine
        Its description.
    configuration
        With the effects that it has.
    demands
        Component → the command of an actuator, or where a joint goes that a sensor prescribes,
        shape (ticks,).

    Returns
    -------
    Moved
        What all its sensors read.
    """
    plant, period = configuration.plant, configuration.timing.period
    model, found = _at_start(machine, configuration, demands)
    moved = model.move(plant)
    for row in _list_sensors(machine, plant):
        if row.name not in found:
            true = model.observe(row, moved)
            found[row.name] = apply_sensor(getattr(plant, row.name), true, period)
    return Moved(found, not runs_away(moved))


def move_commanded(
    machine: Machine,
    configuration: Configuration,
    demands: dict[str, Array],
    outputs: Sequence[str],
    command: Command,
    noise: Mapping[str, Array],
    ticks: int,
) -> Moved:
    """What the sensors read and what a controller commanded, noise and bits apart of what it does
    not read.

    Parameters
    ----------
    machine, configuration, demands
        As of `move_freely`.
    outputs
        Actuators that the controller commands.
    command
        The controller.
    noise
        Sensor → what is added to its reading, shape (ticks,).
    ticks
        Of the test.

    Returns
    -------
    Moved
        Readings of all its sensors, and the commands of `outputs`.
    """
    plant, period = configuration.plant, configuration.timing.period
    nothing = {name: np.zeros(ticks) for name in outputs}
    model, found = _at_start(machine, configuration, {**nothing, **demands})
    sensors = _list_sensors(machine, plant)
    read = [row for row in sensors if row.kind in ("position", "velocity")]
    readings = Readings(plant, [row.name for row in read], noise, period, ticks)
    moved, given = model.move_commanded(plant, outputs, command, readings, read)
    for row in sensors:
        if row.name not in readings.signals:
            true = model.observe(row, moved)
            found[row.name] = apply_sensor(getattr(plant, row.name), true, period)
    signals = {**found, **readings.signals, **dict(zip(outputs, given, strict=True))}
    return Moved(signals, not runs_away(moved), frozenset({*readings.signals, *outputs}))


def _at_start(
    machine: Machine, configuration: Configuration, demands: dict[str, Array]
) -> tuple[CoupledTwin, dict[str, Array]]:
    """The machine before its test, and what the sensors read that prescribe motions."""
    (replay,) = machine.replays
    plant, period = configuration.plant, configuration.timing.period
    found = {
        name: apply_sensor(getattr(plant, name), demand, period)
        for name, demand in demands.items()
        if measures(getattr(plant, name))
    }
    recording = pose_as_recorded(machine, {**demands, **found}, period)
    unobserved = replace(replay, rows=())
    steps = configuration.substeps
    return CoupledTwin(machine, unobserved, recording, configuration, steps), found


def _list_sensors(machine: Machine, plant: Plant) -> list[Row]:
    """The sensors, each with what it reads."""
    return [
        Row(name, kind, component.channel, component.unit)
        for name, component in machine.components.items()
        if (kind := measures(getattr(plant, name)))
        and component.channel is not None
        and component.acts_on
    ]
