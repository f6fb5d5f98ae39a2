"""The twin of joints some of which are free: what their sensors read in a test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.components import UNLIMITED, ForceActuator, Servo, measures
from rigtwin.components.conditioning import actuator
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor
from rigtwin.components.servo import push_law
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine, ReplayOf, Row
from rigtwin.models.commanding import Command, Readings, commands_of
from rigtwin.models.demands import list_pushers, list_sensors
from rigtwin.models.forward_dynamics import ForwardDynamicsModel, begin
from rigtwin.models.inputs import inputs_of_test
from rigtwin.models.inverse_twin import SimulatedSignals
from rigtwin.models.multibody import Multibody
from rigtwin.models.stepped_twin import Drive, Sensing, SteppedTwin
from rigtwin.numerics.arrays import Array, runs_away


class ForwardDynamicsTwin(ForwardDynamicsModel):
    """All joints in a test to come, advanced tick by tick under a controller."""

    def _bodies_of(self, plant: Plant) -> Multibody:
        """With the mass of joints that are described one by one."""
        found, shares = super()._bodies_of(plant), dict[str, float]()
        for replay in self._machine.replays:
            own = replay.joint.inertia - replay.joint.armature
            if replay.mass is not None and own > 0.0:
                shares[replay.joint.name] = getattr(plant, replay.mass).mass / own
        return found.scale(shares) if any(share != 1.0 for share in shares.values()) else found

    def begin(self, plant: Plant, outputs: Sequence[str], sensors: Sequence[Row]) -> SteppedTwin:
        """The machine at the beginning of its test.

        Parameters
        ----------
        plant
            Its components.
        outputs
            Force actuators and servos that are commanded tick by tick.
        sensors
            That are read tick by tick.
        """
        h = self._period / self._steps
        multibody = self._bodies_of(plant)
        inputs = self._inputs(plant, self._push(plant), self._condition(plant, self._servos))
        contacts = self._contacts(plant, inputs.pushes)
        data = multibody.data()
        return SteppedTwin(
            bodies=multibody.bodies(data, self._turning(plant)),
            owner=data,
            contacts=contacts,
            free=self._free,
            held=self._held,
            state=begin(contacts, self._start_of(plant), inputs.prescribed, self._held, h),
            inputs=inputs,
            laws=[push_law(getattr(plant, name)) for name in self._servos],
            drives=[self._drive(plant, name, h) for name in outputs],
            sensing=[Sensing(r, self._along[r.name], self._zero[r.name]) for r in sensors],
            h=h,
            steps=self._steps,
        )

    def simulate_controlled(
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
        plant, outputs
            As of `begin`.
        command
            Of a tick, by what was read.
        readings, sensors
            What the controller reads.

        Returns
        -------
        tuple
            Positions, velocities and forces, shape (3, coordinates, ticks), as `move` has them;
            commands, shape (outputs, ticks).
        """
        stepped = self.begin(plant, outputs, sensors)
        fields = [self._field(name) for name in outputs]
        out = np.zeros((3, self._bodies.coordinates, self._ticks))
        given = np.zeros((len(outputs), self._ticks))
        for tick in range(self._ticks):
            read = readings.take(tick, stepped.sense())
            given[:, tick] = told = commands_of(command(tick, read), fields)
            out[:, :, tick] = stepped.step(told)
        return out, given

    def _drive(self, plant: Plant, name: str, h: float) -> Drive:
        mover: ForceActuator | Servo = getattr(plant, name)
        model = actuator(mover, plant.computer, h)
        if isinstance(mover, Servo):
            return Drive(model, 1.0, UNLIMITED, True, self._servos.index(name))
        limit = self._limit(plant, name)
        return Drive(model, mover.constant, limit, False, self._pushers.index(name))

    def list_sensors(self, plant: Plant) -> list[Row]:
        """The sensors of its joints, each with what it reads."""
        return [
            Row(name, kind, component.channel, component.unit)
            for name, component in self._machine.components.items()
            if (kind := measures(getattr(plant, name)))
            and component.channel is not None
            and component.acts_on
            and self._along[name].any()
        ]

    def _field(self, name: str) -> str:
        channel = self._machine.components[name].channel
        return name if channel is None else channel[1]


def list_parts(machine: Machine) -> list[ReplayOf]:
    """What of a machine goes together in its twin: all joints that are pushed, free ones with them,
    and each that is prescribed and acts on no other."""
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
    """A machine whose joints are all pushed, before a test of any length.

    Parameters
    ----------
    machine
        Its description.
    configuration
        With the effects that it has.
    outputs, sensors
        All its actuators, and the sensors that are read.
    """
    (replay,) = list_parts(machine)
    nothing: dict[str, Array] = {name: np.zeros(2) for name in outputs}
    twin, _ = _at_start(machine, replay, configuration, nothing)
    return twin.begin(configuration.plant, outputs, sensors)


def simulate_forward(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> SimulatedSignals:
    """What the sensors read, noise and bits apart.

    Parameters
    ----------
    machine
        Its description.
    replay
        Which of its joints.
    configuration
        With the effects that it has.
    demands
        Component → the command of an actuator, or where a joint goes that a sensor prescribes,
        shape (ticks,).

    Returns
    -------
    SimulatedSignals
        What all its sensors read.
    """
    plant, period = configuration.plant, configuration.timing.period
    model, found = _at_start(machine, replay, configuration, demands)
    moved = model.move(plant)
    for row in model.list_sensors(plant):
        if row.name not in found:
            true = model.observe(row, moved)
            found[row.name] = apply_sensor(getattr(plant, row.name), true, period)
    return SimulatedSignals(found, not runs_away(moved))


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
    """What the sensors read and what a controller commanded, noise and bits apart of what it does
    not read.

    Parameters
    ----------
    machine, replay, configuration, demands
        As of `simulate_forward`.
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
    SimulatedSignals
        Readings of all its sensors, and the commands of `outputs`.
    """
    plant, period = configuration.plant, configuration.timing.period
    nothing = {name: np.zeros(ticks) for name in outputs}
    model, found = _at_start(machine, replay, configuration, {**nothing, **demands})
    sensors, readable = model.list_sensors(plant), list_sensors(machine)
    read = [row for row in sensors if row.name in readable]
    readings = Readings(plant, [row.name for row in read], noise, period, ticks)
    moved, given = model.simulate_controlled(plant, outputs, command, readings, read)
    for row in sensors:
        if row.name not in readings.signals:
            true = model.observe(row, moved)
            found[row.name] = apply_sensor(getattr(plant, row.name), true, period)
    signals = {**found, **readings.signals, **dict(zip(outputs, given, strict=True))}
    return SimulatedSignals(signals, not runs_away(moved), frozenset({*readings.signals, *outputs}))


def _at_start(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> tuple[ForwardDynamicsTwin, dict[str, Array]]:
    """The machine before its test, and what the sensors read that prescribe motions."""
    plant, period = configuration.plant, configuration.timing.period
    found = {
        name: apply_sensor(getattr(plant, name), demand, period)
        for name, demand in demands.items()
        if measures(getattr(plant, name))
    }
    inputs = inputs_of_test(machine, {**demands, **found}, period)
    unobserved = replace(replay, rows=())
    steps = configuration.substeps
    return ForwardDynamicsTwin(machine, unobserved, inputs, configuration, steps), found
