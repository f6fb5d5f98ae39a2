"""Twin of joints of which some are free: sensor readings of a test, by forward dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.components import Mass, component_of
from rigtwin.components.conditioning import actuator
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.components.servo import pusher_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.models.commanding import Command, Readings, commands_of
from rigtwin.models.coupled_joints import CoupledJoints, begin
from rigtwin.models.demands import list_pushers, list_sensors
from rigtwin.models.inputs import inputs_of_test
from rigtwin.models.inverse_twin import SimulatedSignals
from rigtwin.models.multibody import Multibody
from rigtwin.models.stepped_twin import IdealSensor, SteppedActuator, SteppedTwin
from rigtwin.numerics.arrays import Array, has_diverged


class ForwardDynamicsTwin(CoupledJoints):
    """Coupled joints of a test that is still to be run."""

    def _bodies_of(self, plant: Plant) -> Multibody:
        """Return the rigid bodies, with the masses of joints that are described one by one."""
        multibody, shares = super()._bodies_of(plant), dict[str, float]()
        for replay in self._machine.replays:
            nominal_mass = replay.joint.inertia - replay.joint.armature
            if replay.mass is not None and nominal_mass > 0.0:
                mass = component_of(plant, replay.mass, Mass).mass
                shares[replay.joint.name] = mass / nominal_mass
        return (
            multibody.scale(shares) if any(share != 1.0 for share in shares.values()) else multibody
        )

    def begin(self, plant: Plant, outputs: Sequence[str], sensors: Sequence[Row]) -> SteppedTwin:
        """Return the machine at the beginning of its test.

        Parameters
        ----------
        plant
            Components of the machine.
        outputs
            Names of the force actuators and servos that are commanded tick by tick.
        sensors
            Sensors that are read tick by tick.

        Returns
        -------
        SteppedTwin
            Twin that advances one tick at a time.
        """
        drives = self._drives.resolve(plant)
        h = self._period / drives.steps
        multibody = self._bodies_of(plant)
        inputs = drives.collect(plant, {})
        contacts = drives.contacts(plant)
        data = multibody.data()
        return SteppedTwin(
            bodies=multibody.bodies(data, drives.turning(plant)),
            owner=data,
            contacts=contacts,
            free=self._layout.free,
            held=self._layout.held,
            state=begin(
                contacts,
                inputs.pushers,
                self._starts_of(plant)[0],
                inputs.prescribed,
                self._layout.held,
                h,
            ),
            inputs=inputs,
            laws=[self._layout.push_law(plant, name) for name in self._layout.pushers],
            drives=[self._drive(plant, name, h) for name in outputs],
            sensing=[
                IdealSensor(r, self._layout.along[r.name], self._layout.zero[r.name])
                for r in sensors
            ],
            h=h,
            steps=drives.steps,
        )

    def simulate_controlled(
        self,
        plant: Plant,
        outputs: Sequence[str],
        command: Command,
        readings: Readings,
        sensors: Sequence[Row],
    ) -> tuple[Array, Array]:
        """Simulate the test with a controller in the loop.

        Parameters
        ----------
        plant, outputs
            Components and commanded actuators, as in `begin`.
        command
            Controller: tick and readings → command.
        readings, sensors
            Sensors that the controller reads, and their imperfections.

        Returns
        -------
        tuple
            Positions, velocities and forces, shape (3, coordinates, ticks), as returned by `move`,
            and the commands, shape (outputs, ticks).
        """
        stepped = self.begin(plant, outputs, sensors)
        fields = [self._field(name) for name in outputs]
        out = np.zeros((3, self._layout.bodies.coordinates, self._ticks))
        commands = np.zeros((len(outputs), self._ticks))
        for tick in range(self._ticks):
            read = readings.take(tick, stepped.sense())
            commands[:, tick] = command_values = commands_of(command(tick, read), fields)
            out[:, :, tick] = stepped.step(command_values)
        return out, commands

    def _drive(self, plant: Plant, name: str, h: float) -> SteppedActuator:
        model = actuator(pusher_of(plant, name), plant.computer, h)
        return SteppedActuator(model, self._layout.pushers.index(name))

    def list_sensors(self) -> list[Row]:
        """Return the sensors of the joints and the quantity that each reads."""
        return [
            Row(name, kind, component.channel, component.unit)
            for name, component in self._machine.components.items()
            if (kind := component.quantity)
            and component.channel is not None
            and component.acts_on
            and self._layout.along[name].any()
        ]

    def _field(self, name: str) -> str:
        channel = self._machine.components[name].channel
        return name if channel is None else channel[1]


def list_parts(machine: Machine) -> list[ReplayOf]:
    """Return the parts of a machine that its twin simulates one by one.

    All joints pushed by actuators form one part, together with free joints. Each joint with
    prescribed motion that acts on no other is a part of its own.
    """
    pushers = list_pushers(machine)
    alone = [replay for replay in machine.replays if not replay.free]
    pushed = [replay for replay in alone if set(replay.moved_by) <= set(pushers)]
    if not pushed:
        return list(machine.replays)
    together = ReplayOf(
        name=pushed[0].name,
        joint=pushed[0].joint,
        moved_by=tuple(dict.fromkeys(name for each in pushed for name in each.moved_by)),
        rows=(),
        guide=None,
        mass=None,
        closed=False,
        free=tuple(dict.fromkeys(each.joint.name for each in pushed)),
    )
    return [together, *(replay for replay in machine.replays if replay not in pushed)]


def begin_live(
    machine: Machine, configuration: Configuration, outputs: Sequence[str], sensors: Sequence[Row]
) -> SteppedTwin:
    """Return the twin of a machine whose joints are all pushed, before a test of any length.

    Parameters
    ----------
    machine
        Description of the machine.
    configuration
        Settings of the test, with the effects applied.
    outputs, sensors
        Names of all its actuators, and the sensors that are read.

    Returns
    -------
    SteppedTwin
        Twin that advances one tick at a time.
    """
    (replay,) = list_parts(machine)
    # Two ticks are enough: a stepped twin looks at no input beyond the current tick.
    no_demands: dict[str, Array] = {name: np.zeros(2) for name in outputs}
    twin, _ = _at_start(machine, replay, configuration, no_demands)
    return twin.begin(configuration.plant, outputs, sensors)


def simulate_forward(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> SimulatedSignals:
    """Simulate a test whose commands are all known beforehand.

    Parameters
    ----------
    machine
        Description of the machine.
    replay
        Part of the machine, by `list_parts`.
    configuration
        Settings of the test, with the effects applied.
    demands
        Component → command of an actuator, or position of a joint whose sensor prescribes its
        motion, shape (ticks,).

    Returns
    -------
    SimulatedSignals
        Readings of all sensors of this part, without noise and quantisation.
    """
    plant, period = configuration.plant, configuration.timing.period
    model, readings = _at_start(machine, replay, configuration, demands)
    moved = model.move(plant)
    for row in model.list_sensors():
        # Sensors that prescribe motion read their demand, which is in `readings` already.
        if row.name not in readings:
            true = model.observe(row, moved)
            readings[row.name] = apply_sensor(sensor_of(plant, row.name), true, period)
    return SimulatedSignals(readings, not has_diverged(moved))


def simulate_controlled(
    machine: Machine,
    replay: ReplayOf,
    configuration: Configuration,
    demands: dict[str, Array],
    outputs: Sequence[str],
    command: Command,
    noise: Mapping[str, Array],
    ticks: int,
) -> SimulatedSignals:
    """Simulate a test with a controller in the loop.

    Parameters
    ----------
    machine, replay, configuration, demands
        Machine and test, as in `simulate_forward`.
    outputs
        Names of the actuators that the controller commands.
    command
        Controller: tick and readings → command.
    noise
        Sensor → noise added to its reading, shape (ticks,).
    ticks
        Number of ticks of the test.

    Returns
    -------
    SimulatedSignals
        Readings of all sensors, and the commands of `outputs`. Readings of the controller have
        noise and quantisation; the others have neither.
    """
    plant, period = configuration.plant, configuration.timing.period
    no_commands = {name: np.zeros(ticks) for name in outputs}
    model, prescribed = _at_start(machine, replay, configuration, {**no_commands, **demands})
    sensors, readable = model.list_sensors(), list_sensors(machine)
    read = [row for row in sensors if row.name in readable]
    readings = Readings(plant, [row.name for row in read], noise, period, ticks)
    moved, commands = model.simulate_controlled(plant, outputs, command, readings, read)
    unread = dict(prescribed)
    for row in sensors:
        if row.name not in readings.signals:
            true = model.observe(row, moved)
            unread[row.name] = apply_sensor(sensor_of(plant, row.name), true, period)
    signals = {**unread, **readings.signals, **dict(zip(outputs, commands, strict=True))}
    return SimulatedSignals(
        signals, not has_diverged(moved), frozenset({*readings.signals, *outputs})
    )


def _at_start(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> tuple[ForwardDynamicsTwin, dict[str, Array]]:
    """Return the model before its test, and the readings of sensors that prescribe motion."""
    plant, period = configuration.plant, configuration.timing.period
    prescribed = {
        name: apply_sensor(sensor_of(plant, name), demand, period)
        for name, demand in demands.items()
        if machine.components[name].quantity
    }
    inputs = inputs_of_test(machine, {**demands, **prescribed}, period)
    unobserved = replace(replay, rows=())
    steps = configuration.substeps
    return ForwardDynamicsTwin(machine, unobserved, inputs, configuration, steps), prescribed
