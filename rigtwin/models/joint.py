"""A joint replayed: its motion prescribed by a sensor or a position actuator, or pushed by a force
actuator."""

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
    measures,
)
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.effect import Motion
from rigtwin.components.guide import friction, friction_size
from rigtwin.components.plant import Plant
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
from rigtwin.numerics.arrays import Array, contain
from rigtwin.recording import Inputs
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import motion_band, smooth, white_noise

INERTIAL = 0.1
"""Share of a measured force that inertia must have for the motion's band to matter."""
KEPT = 24
"""Motions that are kept."""
ELASTIC = 0.3
"""Times a measured motion's error over which friction that reverses builds up at least."""
SMALL = 0.02
"""Share of a signal's swing that is a small disturbance."""
LIGHTEST = 1e-12
"""kg or kg m², of what still moves under a finite force."""
SEED = 7
"""Of the noise whose way through the machine is followed."""
NO_COMMAND = formula("0", {})


def recover_motion(sensor: Sensor, measured: Array, period: float) -> Array:
    """The motion behind a measured one that was smoothed before.

    Parameters
    ----------
    sensor
        Whose offset, drift, gain, lag and delay are undone.
    measured
        Shape (ticks,).
    period
        s, of a tick.

    Returns
    -------
    array
        Shape (ticks,).
    """
    signal = measured
    if sensor.lag > 0.0:
        signal = signal + sensor.lag * np.gradient(signal, period)
    if sensor.delay != 0.0:
        ticks = np.arange(len(signal))
        signal = np.interp(ticks + sensor.delay / period, ticks, signal)
    return (remove_drift(sensor, signal, period) - sensor.offset) / sensor.gain


class JointModel(Model[Plant]):
    """One replay of one recording."""

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
    ) -> None:
        """every: ticks from one that is predicted to the next, of a prescribed motion. Raises
        RigtwinError if a channel is missing."""
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
        # Another controller than the described one cannot be run along: what it commanded is taken.
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
        self._last: dict[tuple[object, ...], Array] = {}
        self._starts: dict[tuple[object, ...], Start] = {}
        self._smoothed: dict[str, tuple[Array, float]] = {}
        self._start = self._find_start()
        self._band = self._find_band()

    @property
    def band(self) -> float:
        """Hz, up to which a measured motion shows its acceleration, where much of the force that it
        takes is inertia; infinite otherwise.

        Above it the smoothed motion lacks what the measured force has: both pass the same filter.
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
        accelerating = inertia * float(np.std(np.gradient(moved[1], self._apart)))
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
        """With fewer ticks if a sensor prescribes the motion."""
        every = max(int(longest / self._period), 1)
        if self._motion is None or every == 1:
            return self
        return JointModel(
            self._machine, self._replay, self._signals, self._configuration, self._steps, every
        )

    @property
    def _apart(self) -> float:
        """s, from one tick that is predicted to the next."""
        return self.every * self._period

    def _find_start(self) -> JointStart | None:
        """By a sensor of the position, or else of the velocity; fitted where a pushed joint in open
        loop needs it."""
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
        """Position and velocity at the start, where a sensor's zero is no place of the joint."""
        if self._start is None:
            return AT_REST
        sensor = getattr(plant, self._start.name)
        if not self._start.fitted:
            return self._start.find(sensor, None)
        key = self._key(plant)
        if key not in self._starts:
            move = self._prepare_pushed(plant, getattr(plant, self._mover.name))
            found = self._start.find(sensor, move)
            self._starts = {**dict(list(self._starts.items())[-KEPT:]), key: found}
        return self._starts[key]

    def _parts(self, plant: Plant) -> tuple[Guide, Inertia]:
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
        """How many times the MJCF's bodies there are; gravity acts on them, not on a rotor."""
        joint, mass = self._replay.joint, self._replay.mass
        own = joint.inertia - joint.armature
        return getattr(plant, mass).mass / own if mass is not None and own > 0.0 else 1.0

    def _armature(self, plant: Plant) -> float:
        """The inertia of what turns with the motor alone, kg or kg m²."""
        rotor = self._replay.rotor
        return self._replay.joint.armature if rotor is None else getattr(plant, rotor).inertia

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """What the motion depends on."""
        replay = self._replay
        names = [replay.guide, replay.mass, replay.rotor, self._mover.name, "computer"]
        if self._control is not None:
            names += self._sensors
        if self._start is not None and self._start.name not in names:
            names.append(self._start.name)
        return tuple(getattr(plant, name) for name in names if name is not None)

    def move(self, plant: Plant, force: Array | None = None, shift: Array | None = None) -> Array:
        """Position, velocity, force on the joint and command, shape (4, ticks). force: another on
        it, N; shift: of its prescribed motion, m; shape (ticks,)."""
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
        out = contain(out)
        if force is None and shift is None:
            self._last = {**dict(list(self._last.items())[-KEPT:]), key: out}
        return out

    def _undo_sensor(self, sensor: Sensor) -> Array:
        """The position behind a measured motion: the sensor's offset, gain, lag and delay undone.
        Of a velocity its mean is no motion, as what is tested does not move away."""
        assert self._motion is not None
        signal = recover_motion(sensor, self._motion, self._period)
        return np.cumsum(signal - np.mean(signal)) * self._period if self._integrated else signal

    def prescribe(self, plant: Plant, signal: Array) -> Array:
        """The joint under a prescribed motion, shape (4, ticks) as `move`. signal: what an ideal
        sensor that moves it would read, shape (ticks,)."""
        position = (
            np.cumsum(signal - np.mean(signal)) * self._period if self._integrated else signal
        )
        return self._inverse_dynamics(plant, position, 0.0)

    def _inverse_dynamics(self, plant: Plant, position: Array, error: float) -> Array:
        guide, inertia = self._parts(plant)
        velocity = np.gradient(position, self._apart)
        acceleration = np.gradient(velocity, self._apart)
        out = np.zeros((4, len(position)))
        out[0], out[1] = position, velocity
        if all(row.kind in ("position", "velocity") for row in self.rows):
            return out
        motion = np.ascontiguousarray(np.stack([position, velocity, acceleration]))
        softest = self._softest(guide, inertia, position, acceleration, error)
        inverse_dynamics(
            guide=guide,
            dry_friction=friction(guide),
            inertia=inertia,
            spring=1.0 / softest,
            period=self._apart,
            motion=motion,
            out=out[2],
        )
        return out

    def _softest(
        self, guide: Guide, inertia: Inertia, position: Array, acceleration: Array, error: float
    ) -> float:
        """Compliance, m/N, over which friction that reverses builds up: no less than what a
        measured motion's error hides."""
        carried_load = inertia.mass * acceleration + guide.stiffness * (position - inertia.rest)
        load = float(np.sqrt(np.mean(carried_load**2)))
        size = max(friction_size(friction(guide), load), 1e-300)
        stroke = max(float(np.ptp(position)), 1e-12)
        return max(guide.compliance, ELASTIC * error / size, 1e-9 * stroke / size)

    def _integrate_pushed(
        self, plant: Plant, mover: Pusher, besides: Array, noise: Array | None = None
    ) -> Array:
        """The joint under its actuator, from where it starts. besides: another force on it,
        N, shape (ticks,); noise: of what a controller reads, shape (ticks, inputs)."""
        return self._prepare_pushed(plant, mover, noise)(self._start_of(plant), besides)

    def _prepare_pushed(
        self, plant: Plant, mover: Pusher, noise: Array | None = None
    ) -> Callable[[Start, Array], Array]:
        """The same from any start, as a function of it and the other force."""
        guide, inertia = self._parts(plant)
        h = self._period / self._steps
        rigid = RIGID * inertia.mass / h**2
        spring = rigid if guide.compliance <= 0.0 else min(1.0 / guide.compliance, rigid)
        dry_friction, conditioning = friction(guide), actuator(mover, plant.computer, h)
        parts = [getattr(plant, name) for name in self._sensors] or [PositionSensor()]
        models = tuple(transducer(part, self._period) for part in parts)
        kinds = np.array([int(measures(part) == "velocity") for part in parts])

        def integrate(start: Start, besides: Array) -> Array:
            command = self._command[: len(besides)].copy()
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
                besides=np.ascontiguousarray(besides),
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
        which = np.array(
            [names.index(channel) if channel in names else -1 for channel in channels], np.int64
        )
        return Loop(
            closed=True,
            program=program,
            registers=program.registers.copy(),
            memory=control.formula.memory(),
            recorded=self._recorded_inputs,
            noise=self._no_noise if noise is None else noise,
            sensor=which,
        )

    @cached_property
    def _recorded_inputs(self) -> Array:
        """What the controller read, as recorded, shape (ticks, inputs)."""
        control = self._control
        assert control is not None
        found = np.zeros((self._signals.ticks, len(control.formula.inputs)))
        for number, name in enumerate(control.formula.inputs):
            found[:, number] = self._signals.column(*control.inputs[name])
        return found

    @cached_property
    def _no_noise(self) -> Array:
        return np.zeros_like(self._recorded_inputs)

    def predict_true(self, plant: Plant) -> Array:
        return self._rows(self.move(plant))

    def _rows(self, moved: Array) -> Array:
        places = {"position": 0, "velocity": 1, "force": 2, "command": 3}
        return moved[[places[row.kind] for row in self.rows]]

    def _apply_sensors(self, plant: Plant, true: Array) -> Array:
        found = true.copy()
        for number, row in enumerate(self.rows):
            if row.kind != "command":
                found[number] = apply_sensor(getattr(plant, row.name), true[number], self._apart)
        return limit_band(found, self.band, self._apart)

    def predict(self, plant: Plant) -> Array:
        return self._apply_sensors(plant, self.predict_true(plant))

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        if entry == "force":
            return self._apply_sensors(plant, self._rows(self.move(plant, force=amount)))
        if entry == "motion":
            return self._apply_sensors(plant, self._rows(self.move(plant, shift=amount)))
        found = self.predict(plant)
        found[[row.name for row in self.rows].index(entry)] += amount
        return found

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
        return forms(role, entry, Passage(signal, moved[0], moved[1], moved[2], self._apart))

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
            # It swings freely: what acts on it is what its inertia shows.
            _, inertia = self._parts(plant)
            force = inertia.mass * np.gradient(moved[1], self._apart)
        return Motion(moved[0], moved[1], force)

    def missing_force(self, plant: Plant) -> Array | None:
        """Where a sensor of its position sees a pushed joint: the force that its measured motion
        takes, less its actuator's."""
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
        # As the actuator got it, in a closed loop too.
        commanded = np.ascontiguousarray(self._signals.column(*channel))
        conditioning = actuator(mover, plant.computer, self._period)
        command = np.zeros(len(position))
        condition_all(conditioning, hold(conditioning, float(commanded[0])), commanded, 1, command)
        return taken - push_all(push_law(mover), command, position, velocity)

    def propagated_noise(self, plant: Plant) -> Array | None:
        """What the noise of a measured motion makes of the force, or that of a controller's sensors
        of its command."""
        random = np.random.default_rng(SEED)
        ticks = self._signals.ticks
        if self._motion is not None and self._error > 0.0 and not self._integrated:
            assert self._mover.channel is not None
            level = white_noise(self._signals.column(*self._mover.channel))
            again, _ = smooth(self._motion + level * random.standard_normal(ticks), self._period)
            shift = (again - self._motion)[:: self.every]
            carried = self._rows(self.move(plant, shift=shift)) - self._rows(self.move(plant))
            return limit_band(carried, self.band, self._apart)
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
        found = np.zeros((len(self.rows), ticks))
        commands = [row.kind == "command" for row in self.rows]
        found[commands] = disturbed[3] - self.move(plant)[3]
        return found
