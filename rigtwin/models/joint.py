"""Model of one joint that does not act on others.

Its motion is either prescribed by a sensor or a position actuator, and the force is predicted by
inverse dynamics; or a force actuator or servo pushes it, and its motion is predicted by forward
dynamics. Both follow the equation of motion in `joint_motion`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from controllers.formula import formula
from rigtwin.components import (
    PUSHERS,
    Guide,
    PositionActuator,
    PositionSensor,
    Pusher,
    Schedule,
    measures,
)
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.effect import Motion
from rigtwin.components.guide import friction, friction_size
from rigtwin.components.plant import Plant
from rigtwin.components.schedule import follow, scheduled_force
from rigtwin.components.sensors import (
    Sensor,
    apply_sensor,
    remove_drift,
    start_transducer,
    transducer,
)
from rigtwin.components.servo import push_all, push_law
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import FormulaControl
from rigtwin.description.machine import OWN, Machine, ReplayOf, Row
from rigtwin.models.basis import Passage, forms
from rigtwin.models.following import follow_command
from rigtwin.models.joint_motion import RIGID, Inertia, Loop, integrate_pushed, inverse_dynamics
from rigtwin.models.joint_start import AT_REST, JointStart
from rigtwin.models.model import Form, Model
from rigtwin.models.start import Start
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.recording import Inputs
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import motion_band, smooth, white_noise

INERTIAL = 0.1
"""Share of inertia in the measured force above which the band of the motion limits the force."""
KEPT = 24
"""Number of motions that are remembered."""
ELASTIC = 0.3
"""Shortest distance over which friction that reverses builds up, in errors of the measured motion.
Without it, friction would jump with the noise of the velocity's sign."""
SMALL = 0.02
"""Size of a small disturbance, as a share of the signal's standard deviation."""
LIGHTEST = 1e-12
"""Smallest inertia of a joint, kg or kg m². Below it, a finite force has no finite acceleration."""
SEED = 7
"""Seed of the noise that is propagated through the machine."""
NO_COMMAND = formula("0", {})


def recover_motion(sensor: Sensor, measured: Array, period: float) -> Array:
    """Recover the true motion from a measured one that was smoothed.

    Inverts the sensor y = gain·x + offset + drift·t, its first-order lag and its delay.

    Parameters
    ----------
    sensor
        Sensor whose offset, drift, gain, lag and delay are undone.
    measured
        Smoothed reading, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        True motion, shape (ticks,).
    """
    # A lag T is inverted by x = y + T·y', which needs a smooth signal.
    signal = measured
    if sensor.lag > 0.0:
        signal = signal + sensor.lag * np.gradient(signal, period)
    if sensor.delay != 0.0:
        ticks = np.arange(len(signal))
        signal = np.interp(ticks + sensor.delay / period, ticks, signal)
    return (remove_drift(sensor, signal, period) - sensor.offset) / sensor.gain


class JointModel(Model[Plant]):
    """Model of one joint of one recording.

    Parameters
    ----------
    machine, replay, inputs, configuration, steps
        Machine, replay of the joint, recorded signals, settings and integration steps per tick, as
        in `Physics.model`.
    every
        Ticks of the recording from one predicted tick to the next, of a prescribed motion.

    Raises
    ------
    RigtwinError
        If a channel is missing from the recording.
    """

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
    ) -> None:
        self._machine, self._replay, self._signals, self._steps = (
            machine,
            replay,
            inputs,
            steps,
        )
        self.every = every
        self._configuration = configuration
        self._period = inputs.period
        self.rows: tuple[Row, ...] = replay.rows
        self._mover = machine.components[replay.moved_by[0]]
        assert self._mover.channel is not None
        topic, name = self._mover.channel
        # A controller of the user's own cannot be run along: its recorded commands are used.
        closed = replay.closed and OWN not in inputs.controller
        self._control = control = (
            machine.control if isinstance(machine.control, FormulaControl) and closed else None
        )
        self._command = np.zeros(inputs.ticks)
        self._motion: Array | None = None
        self._error = 0.0
        kind = getattr(machine.plant, self._mover.name)
        self._integrated = measures(kind) == "velocity"
        if measures(kind) in ("position", "velocity"):
            self._motion, self._error = smooth(inputs.column(topic, name), self._period)
        elif not closed:
            self._command = inputs.column(topic, name)
        self._controller_inputs = {}
        self._program = NO_COMMAND.program
        if control is not None:
            self._program = control.program(configuration.controller._asdict())
            self._controller_inputs = {name: channel for name, channel in control.inputs.items()}
            for channel in self._controller_inputs.values():
                inputs.column(*channel)
        self._sensors = [
            name
            for name, component in machine.components.items()
            if component.joint == replay.joint.name
            and component.channel in self._controller_inputs.values()
            and measures(getattr(machine.plant, name)) in ("position", "velocity")
        ]
        self._schedules: dict[str, Array] = {
            name: inputs.column(*component.channel)
            for name, component in machine.components.items()
            if component.joint == replay.joint.name
            and component.channel is not None
            and isinstance(getattr(machine.plant, name), Schedule)
        }
        """Name of each schedule of the joint → values of its channel, shape (ticks,)."""
        self._last: dict[tuple[object, ...], Array] = {}
        self._starts: dict[tuple[object, ...], Start] = {}
        self._smoothed: dict[str, tuple[Array, float]] = {}
        self._start = self._find_start()
        self._band = self._find_band()

    @property
    def band(self) -> float:
        """Highest frequency at which a measured motion shows its acceleration, Hz.

        It is infinite where inertia is a small part of the force. Above the band, smoothing has
        removed the acceleration from the motion. Predicted and measured forces are compared through
        the same low-pass filter.
        """
        return self._band

    def _find_band(self) -> float:
        if self._motion is None or self._integrated or self._error == 0.0:
            return math.inf
        rows = [row for row in self.rows if row.kind == "force"]
        if not rows:
            return math.inf
        moved = self.move(self._configuration.plant)
        inertia = self._parts(self._configuration.plant)[1].mass
        accelerating = inertia * float(np.std(np.gradient(moved[1], self._interval)))
        measured = float(np.std(self._signals.column(*rows[0].channel)))
        if accelerating < INERTIAL * measured:
            return math.inf
        assert self._mover.channel is not None
        return motion_band(self._signals.column(*self._mover.channel), self._period)

    def halve_steps(self) -> JointModel:
        return self._with_steps(max(1, self._steps // 2))

    def double_steps(self) -> JointModel:
        return self._with_steps(2 * self._steps)

    def _with_steps(self, steps: int) -> JointModel:
        return JointModel(
            self._machine, self._replay, self._signals, self._configuration, steps, self.every
        )

    def thin(self, longest: float) -> JointModel:
        """Return a model with fewer ticks if a sensor prescribes the motion, or else itself."""
        every = max(int(longest / self._period), 1)
        if self._motion is None or every == 1:
            return self
        return JointModel(
            self._machine, self._replay, self._signals, self._configuration, self._steps, every
        )

    @property
    def _interval(self) -> float:
        """Time from one predicted tick to the next, s."""
        return self.every * self._period

    def _find_start(self) -> JointStart | None:
        """Return the initial state of a pushed joint, or None for a prescribed motion.

        It is read from a position sensor or else a velocity sensor, and fitted in open loop: a
        controller makes the joint forget it.
        """
        if not self._free:
            return None
        rows = {row.name: row for row in self.rows if row.kind in ("position", "velocity")}
        plant, components = self._configuration.plant, self._machine.components
        kinds = {name: measures(getattr(plant, name)) for name in (*rows, *self._sensors)}
        name = min(kinds, key=lambda name: kinds[name] != "position", default=None)
        if name is None:
            return None
        channel = components[name].channel
        assert channel is not None
        start = JointStart(name, kinds[name], self._signals.column(*channel), self._period)
        if name in rows and self._control is None:
            move = self._prepare_pushed(plant, getattr(plant, self._mover.name))
            nominal = getattr(self._machine.plant, name)
            start.judge(nominal, move, self._machine.form_of(rows[name]), self._command)
        return start

    def _start_of(self, plant: Plant) -> Start:
        """Return initial position and velocity, corrected for the sensor's zero, m and m/s."""
        if self._start is None:
            return AT_REST
        sensor = getattr(plant, self._start.name)
        if not self._start.fitted:
            return self._start.find(sensor, None)
        key = self._key(plant)
        if key not in self._starts:
            move = self._prepare_pushed(plant, getattr(plant, self._mover.name))
            start = self._start.find(sensor, move)
            self._starts = {**dict(list(self._starts.items())[-KEPT:]), key: start}
        return self._starts[key]

    def _parts(self, plant: Plant) -> tuple[Guide, Inertia]:
        """Return guide and inertia of the joint as compiled code takes them."""
        replay = self._replay
        guide = Guide() if replay.guide is None else getattr(plant, replay.guide)
        mass = 0.0 if replay.mass is None else getattr(plant, replay.mass).mass
        joint = replay.joint
        share = self._share_of_mass(plant)
        if replay.mass is not None or replay.rotor is not None:
            mass += self._armature(plant)
        load = share * np.array(joint.gravity)
        spacing = (joint.positions[-1] - joint.positions[0]) / max(len(joint.gravity) - 1, 1)
        guide = Guide(*(float(value) for value in guide))
        mass = max(float(mass), LIGHTEST)
        return guide, Inertia(mass, joint.positions[0], spacing, load, joint.rest, joint.goes_round)

    def _share_of_mass(self, plant: Plant) -> float:
        """Return the factor on the mass of the MJCF's bodies.

        It scales the gravity load. A rotor (armature) has inertia but no weight, so it is excluded.
        """
        joint, mass = self._replay.joint, self._replay.mass
        nominal = joint.inertia - joint.armature
        return getattr(plant, mass).mass / nominal if mass is not None and nominal > 0.0 else 1.0

    def _armature(self, plant: Plant) -> float:
        """Return the inertia of the rotor behind its gear, kg or kg m²."""
        rotor = self._replay.rotor
        return self._replay.joint.armature if rotor is None else getattr(plant, rotor).inertia

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that the motion depends on, as a key of remembered motions."""
        replay = self._replay
        names = [replay.guide, replay.mass, replay.rotor, self._mover.name, "computer"]
        names += self._schedules
        if self._control is not None:
            names += self._sensors
        if self._start is not None and self._start.name not in names:
            names.append(self._start.name)
        return tuple(getattr(plant, name) for name in names if name is not None)

    def move(self, plant: Plant, force: Array | None = None, shift: Array | None = None) -> Array:
        """Simulate the joint.

        Parameters
        ----------
        plant
            Components of the machine.
        force
            Unmodelled force on the joint, N, shape (ticks,). Default: none.
        shift
            Displacement of its prescribed motion, m, shape (ticks,). Default: none.

        Returns
        -------
        array
            Position, velocity, force and command, shape (4, ticks). The force is that of the
            actuator, or the one that the prescribed motion requires.
        """
        key = self._key(plant)
        if force is None and shift is None and key in self._last:
            return self._last[key]
        mover = getattr(plant, self._mover.name)
        if isinstance(mover, PUSHERS):
            out = self._integrate_pushed(
                plant, mover, np.zeros(len(self._command)) if force is None else force
            )
        else:
            if isinstance(mover, PositionActuator):
                position = follow_command(
                    mover, self._command, plant.computer.delay, self._period, self._steps
                )
                error = 0.0
            else:
                position = self._undo_sensor(mover)[:: self.every]
                error = 0.0 if self._integrated else self._error / max(mover.gain, 1e-9)
            out = self._inverse_dynamics(
                plant, position if shift is None else position + shift, error
            )
            if force is not None:
                out[2] -= force
        out = clip_diverged(out)
        if force is None and shift is None:
            self._last = {**dict(list(self._last.items())[-KEPT:]), key: out}
        return out

    def _undo_sensor(self, sensor: Sensor) -> Array:
        """Return the position behind the measured motion, m, shape (ticks,).

        A measured velocity is integrated without its mean: that is the sensor's offset, as a tested
        joint does not move away.
        """
        assert self._motion is not None
        signal = recover_motion(sensor, self._motion, self._period)
        return np.cumsum(signal - np.mean(signal)) * self._period if self._integrated else signal

    def prescribe(self, plant: Plant, signal: Array) -> Array:
        """Simulate the joint with a prescribed motion.

        Parameters
        ----------
        plant
            Components of the machine.
        signal
            Reading of an ideal sensor of the motion (position or velocity), shape (ticks,).

        Returns
        -------
        array
            Position, velocity, force and command, shape (4, ticks), as in `move`.
        """
        position = (
            np.cumsum(signal - np.mean(signal)) * self._period if self._integrated else signal
        )
        return self._inverse_dynamics(plant, position, 0.0)

    def _inverse_dynamics(self, plant: Plant, position: Array, error: float) -> Array:
        """Return `move` of a prescribed position, m, whose standard error is `error`, m."""
        guide, inertia = self._parts(plant)
        velocity = np.gradient(position, self._interval)
        acceleration = np.gradient(velocity, self._interval)
        out = np.zeros((4, len(position)))
        out[0], out[1] = position, velocity
        # Nobody asks for the force: skip it.
        if all(row.kind in ("position", "velocity") for row in self.rows):
            return out
        motion = np.ascontiguousarray(np.stack([position, velocity, acceleration]))
        softest = self._softest(guide, inertia, position, acceleration, error)
        inverse_dynamics(
            guide=guide,
            dry_friction=friction(guide),
            inertia=inertia,
            spring=1.0 / softest,
            period=self._interval,
            motion=motion,
            out=out[2],
        )
        if self._schedules:
            stroke = max(float(np.ptp(position)), 1e-12)
            over = max(ELASTIC * error, 1e-9 * stroke)
            for name, recorded in self._schedules.items():
                schedule = getattr(plant, name)
                level = follow(schedule, recorded, self._period)[:: self.every]
                out[2] += scheduled_force(schedule, level, motion, 1.0 / over)
        return out

    def _softest(
        self, guide: Guide, inertia: Inertia, position: Array, acceleration: Array, error: float
    ) -> float:
        """Return the compliance in series with dry friction, m/N.

        The error of the measured motion hides smaller ones: friction that reverses builds up over
        at least that distance.
        """
        carried_load = inertia.mass * acceleration + guide.stiffness * (position - inertia.rest)
        load = float(np.sqrt(np.mean(carried_load**2)))
        size = max(friction_size(friction(guide), load), 1e-300)
        stroke = max(float(np.ptp(position)), 1e-12)
        return max(guide.compliance, ELASTIC * error / size, 1e-9 * stroke / size)

    def _integrate_pushed(
        self, plant: Plant, mover: Pusher, disturbance: Array, noise: Array | None = None
    ) -> Array:
        """Return `move` of a pushed joint, shape (4, ticks).

        `disturbance` is an unmodelled force, N, shape (ticks,). `noise` is that of the controller's
        inputs, shape (ticks, inputs).
        """
        return self._prepare_pushed(plant, mover, noise)(self._start_of(plant), disturbance)

    def _prepare_pushed(
        self, plant: Plant, mover: Pusher, noise: Array | None = None
    ) -> Callable[[Start, Array], Array]:
        """Return a function that integrates the joint.

        Its arguments are the initial state and a disturbance, N, shape (ticks,), whose length is
        the number of ticks.
        """
        guide, inertia = self._parts(plant)
        h = self._period / self._steps
        rigid = RIGID * inertia.mass / h**2
        spring = rigid if guide.compliance <= 0.0 else min(1.0 / guide.compliance, rigid)
        dry_friction, conditioning = friction(guide), actuator(mover, plant.computer, h)
        parts = [getattr(plant, name) for name in self._sensors] or [PositionSensor()]
        models = tuple(transducer(part, self._period) for part in parts)
        kinds = np.array([int(measures(part) == "velocity") for part in parts])

        def integrate(start: Start, disturbance: Array) -> Array:
            command = self._command[: len(disturbance)].copy()
            out = np.zeros((4, len(command)))
            integrate_pushed(
                guide=guide,
                dry_friction=dry_friction,
                inertia=inertia,
                spring=spring,
                start=start,
                law=push_law(mover),
                drive=conditioning,
                held=hold(conditioning, float(self._command[0])),
                sensors=models,
                states=tuple(start_transducer(model) for model in models),
                kinds=kinds,
                loop=self._loop(noise),
                command=command,
                disturbance=np.ascontiguousarray(disturbance),
                period=self._period,
                steps=self._steps,
                out=out,
            )
            out[3] = command
            return out

        return integrate

    def _loop(self, noise: Array | None) -> Loop:
        control = self._control
        program = self._program
        if control is None:
            return Loop(
                closed=False,
                program=program,
                registers=program.registers.copy(),
                memory=NO_COMMAND.memory(),
                recorded=np.zeros((1, 1)),
                noise=np.zeros((1, 1)),
                sensor=np.zeros(0, np.int64),
            )
        names = [self._machine.components[name].channel for name in self._sensors]
        channels = [control.inputs[name] for name in control.formula.inputs]
        sensor_of_input = np.array(
            [names.index(channel) if channel in names else -1 for channel in channels], np.int64
        )
        return Loop(
            closed=True,
            program=program,
            registers=program.registers.copy(),
            memory=control.formula.memory(),
            recorded=self._recorded_inputs,
            noise=self._no_noise if noise is None else noise,
            sensor=sensor_of_input,
        )

    @cached_property
    def _recorded_inputs(self) -> Array:
        """Recorded inputs of the controller, shape (ticks, inputs)."""
        control = self._control
        assert control is not None
        recorded = np.zeros((self._signals.ticks, len(control.formula.inputs)))
        for number, name in enumerate(control.formula.inputs):
            recorded[:, number] = self._signals.column(*control.inputs[name])
        return recorded

    @cached_property
    def _no_noise(self) -> Array:
        return np.zeros_like(self._recorded_inputs)

    def predict_true(self, plant: Plant) -> Array:
        return self._rows(self.move(plant))

    def _rows(self, moved: Array) -> Array:
        places = {"position": 0, "velocity": 1, "force": 2, "command": 3}
        return moved[[places[row.kind] for row in self.rows]]

    def _apply_sensors(self, plant: Plant, true: Array) -> Array:
        sensed = true.copy()
        for number, row in enumerate(self.rows):
            if row.kind != "command":
                sensed[number] = apply_sensor(
                    getattr(plant, row.name), true[number], self._interval
                )
        return limit_band(sensed, self.band, self._interval)

    def predict(self, plant: Plant) -> Array:
        return self._apply_sensors(plant, self.predict_true(plant))

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        if entry == "force":
            return self._apply_sensors(plant, self._rows(self.move(plant, force=amount)))
        if entry == "motion":
            return self._apply_sensors(plant, self._rows(self.move(plant, shift=amount)))
        predicted = self.predict(plant)
        predicted[[row.name for row in self.rows].index(entry)] += amount
        return predicted

    def components(self) -> tuple[str, ...]:
        replay = self._replay
        moving = (
            [replay.guide, replay.mass, replay.rotor]
            if any(row.kind != "position" for row in self.rows) or self._free
            else []
        )
        sensors = [row.name for row in self.rows if row.kind != "command"]
        return tuple(name for name in (*moving, self._mover.name, *sensors) if name is not None)

    @property
    def _free(self) -> bool:
        return isinstance(getattr(self._machine.plant, self._mover.name), PUSHERS)

    def forms(self, component: str, plant: Plant) -> list[Form]:
        moved = self.move(plant)
        names = [row.name for row in self.rows]
        role, entry, signal = "guide", "force", moved[2]
        if component in names:
            role, entry, signal = "sensor", component, self.predict(plant)[names.index(component)]
        elif component == self._mover.name:
            role, entry, signal = (
                ("force", "force", moved[2]) if self._free else ("position", "motion", moved[0])
            )
        elif component in (self._replay.mass, self._replay.rotor):
            role = "mass"
        return forms(role, entry, Passage(signal, moved[0], moved[1], moved[2], self._interval))

    def disturbance_size(self, entry: str) -> float:
        moved = self.move(self._machine.plant)
        if entry in ("force", "motion"):
            return SMALL * max(float(np.std(moved[2 if entry == "force" else 0])), 1e-9)
        number = [row.name for row in self.rows].index(entry)
        return SMALL * max(float(np.std(self._rows(moved)[number])), 1e-9)

    def motion(self, component: str, plant: Plant) -> Motion:  # noqa: ARG002
        moved = self.move(plant)
        force = moved[2]
        if not force.any():
            # No actuator acts: the force is inertia times acceleration.
            _, inertia = self._parts(plant)
            force = inertia.mass * np.gradient(moved[1], self._interval)
        return Motion(moved[0], moved[1], force)

    def missing_force(self, plant: Plant) -> Array | None:
        """Return the residual force required to reproduce the measured motion, N, shape (ticks,).

        It is the force by inverse dynamics less the actuator's. None unless a position sensor sees
        a pushed joint.
        """
        row = next((row for row in self.rows if row.kind == "position"), None)
        if row is None or not self._free:
            return None
        if row.name not in self._smoothed:
            self._smoothed[row.name] = smooth(self._signals.column(*row.channel), self._period)
        measured, error = self._smoothed[row.name]
        sensor, mover = getattr(plant, row.name), getattr(plant, self._mover.name)
        position = recover_motion(sensor, measured, self._period)
        guide, inertia = self._parts(plant)
        velocity = np.gradient(position, self._period)
        motion = np.stack([position, velocity, np.gradient(velocity, self._period)])
        taken = np.zeros(len(position))
        inverse_dynamics(
            guide=guide,
            dry_friction=friction(guide),
            inertia=inertia,
            spring=1.0 / self._softest(guide, inertia, position, motion[2], error),
            period=self._period,
            motion=np.ascontiguousarray(motion),
            out=taken,
        )
        channel = self._mover.channel
        assert channel is not None
        # The recorded command, in closed loop too: it is the one that moved the joint.
        commanded = np.ascontiguousarray(self._signals.column(*channel))
        conditioning = actuator(mover, plant.computer, self._period)
        command = np.zeros(len(position))
        condition_all(conditioning, hold(conditioning, float(commanded[0])), commanded, 1, command)
        return taken - push_all(push_law(mover), command, position, velocity)

    def propagated_noise(self, plant: Plant) -> Array | None:
        """Return the change of the predictions by the noise of the inputs, shape (rows, ticks).

        For a prescribed motion, the noise of its sensor changes the force. In closed loop, the
        noise of the controller's sensors changes the command.
        """
        random = np.random.default_rng(SEED)
        ticks = self._signals.ticks
        if self._motion is not None and self._error > 0.0 and not self._integrated:
            assert self._mover.channel is not None
            level = white_noise(self._signals.column(*self._mover.channel))
            again, _ = smooth(self._motion + level * random.standard_normal(ticks), self._period)
            shift = (again - self._motion)[:: self.every]
            carried = self._rows(self.move(plant, shift=shift)) - self._rows(self.move(plant))
            return limit_band(carried, self.band, self._interval)
        control = self._control
        if control is None or not self._sensors:
            return None
        sensed = [self._machine.components[name].channel for name in self._sensors]
        columns = [self._signals.column(*channel) for channel in control.channels]
        noise = np.zeros((ticks, len(columns)))
        for number, (channel, column) in enumerate(zip(control.channels, columns, strict=True)):
            if channel in sensed:
                noise[:, number] = white_noise(column) * random.standard_normal(ticks)
        mover = getattr(plant, self._mover.name)
        disturbed = self._integrate_pushed(plant, mover, np.zeros(ticks), noise)
        change = np.zeros((len(self.rows), ticks))
        commands = [row.kind == "command" for row in self.rows]
        change[commands] = disturbed[3] - self.move(plant)[3]
        return change
