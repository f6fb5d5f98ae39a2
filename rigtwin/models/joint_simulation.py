"""Simulation of one joint that does not act on others, under the inputs of one recording.

Its motion is either prescribed by a sensor or a position actuator, and the force follows by inverse
dynamics; or a force actuator or servo pushes it, and its motion follows by forward dynamics. Both
follow the equation of motion in `joint_motion`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigtwin.components import (
    PUSHERS,
    Guide,
    Mass,
    PositionActuator,
    Rotor,
    Schedule,
    Warming,
    component_of,
)
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.end_stops import soften_stops
from rigtwin.components.guide_step import guide_step_of
from rigtwin.components.plant import Plant, select
from rigtwin.components.schedule import follow, scheduled_force
from rigtwin.components.sensors import Sensor, sensor_of
from rigtwin.components.servo import Push, play_of, push_all, push_law, pusher_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf
from rigtwin.models.following import follow_command
from rigtwin.models.joint_control import JointControl
from rigtwin.models.joint_inverse import inverse_dynamics
from rigtwin.models.joint_motion import RIGID, Drive, Inertia, integrate_pushed
from rigtwin.models.joint_start import AT_REST, JointStart
from rigtwin.models.measured_motion import ELASTIC, recover_motion, softest_contact
from rigtwin.models.start import Start
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.numerics.memo import Memo
from rigtwin.recording import Inputs
from rigtwin.signals.motion import SmoothedMotion, smooth

KEPT = 24
"""Number of motions that are remembered."""
CONTACT_STEPS = 4
"""Factor on the integration steps of a joint with play: the impact of two teeth takes a few ms."""
LIGHTEST = 1e-12
"""Smallest inertia of a joint, kg or kg m². Below it, a finite force has no finite acceleration."""


class JointSimulation:
    """Simulation of one joint under the inputs of one recording.

    Parameters
    ----------
    machine, replay, inputs, configuration, steps
        Machine, replay of the joint, recorded signals, settings and integration steps per tick, as
        in `Physics.model`.
    every
        Ticks of the recording from one simulated tick to the next, of a prescribed motion.

    Attributes
    ----------
    mover : Component
        Sensor or actuator that moves the joint.
    control : JointControl
        Source of the command of a pushed joint.
    linear : bool
        Whether errors of the initial state are corrected to first order. They are fitted otherwise.
    smoothed : SmoothedMotion or None
        Smoothed reading of the sensor that prescribes the motion. None for a joint that an actuator
        moves.

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
        linear: bool = False,
    ) -> None:
        self._machine, self._replay, self._signals = machine, replay, inputs
        self._steps, self.every, self._configuration = steps, every, configuration
        self._period = inputs.period
        self.mover = machine.components[replay.moved_by[0]]
        assert self.mover.channel is not None
        self.control = JointControl(machine, replay, inputs, configuration)
        self._command = np.zeros(inputs.ticks)
        self.smoothed: SmoothedMotion | None = None
        self.integrated = self.mover.quantity == "velocity"
        if self.mover.quantity in ("position", "velocity"):
            self.smoothed = smooth(inputs.column(*self.mover.channel), self._period)
        elif not self.control.closed:
            self._command = inputs.column(*self.mover.channel)
        self._schedules: dict[str, Array] = {
            component.name: inputs.column(*component.channel)
            for component in machine.components_of(Schedule)
            if component.joint == replay.joint.name and component.channel is not None
        }
        """Name of each schedule of the joint → values of its channel, shape (ticks,)."""
        self._warming = [
            component.name
            for component in machine.components_of(Warming)
            if component.joint == replay.joint.name
        ]
        self._last: Memo[Array] = Memo(KEPT)
        self._starts: Memo[Start] = Memo(KEPT)
        self._start = self._find_start()
        self.linear = linear

    @property
    def pushed(self) -> bool:
        """Whether a force moves the joint, so that its motion follows by forward dynamics."""
        return self.mover.component_type in PUSHERS

    @property
    def error(self) -> float:
        """Standard error of the measured position that prescribes the motion, m; else 0."""
        return 0.0 if self.smoothed is None or self.integrated else self.smoothed.error

    @property
    def interval(self) -> float:
        """Time from one simulated tick to the next, s."""
        return self.every * self._period

    # Initial state

    def _find_start(self) -> JointStart | None:
        """Return the initial state of a pushed joint, or None for a prescribed motion.

        It is read from a position sensor or else a velocity sensor, and fitted in open loop: a
        controller makes the joint forget it.
        """
        if not self.pushed:
            return None
        components = self._machine.components
        rows = {row.name: row for row in self._replay.rows if row.kind in ("position", "velocity")}
        kinds = {name: components[name].quantity for name in (*rows, *self.control.sensors)}
        name = min(kinds, key=lambda name: kinds[name] != "position", default=None)
        if name is None:
            return None
        channel = components[name].channel
        assert channel is not None
        start = JointStart(name, kinds[name], self._signals.column(*channel), self._period)
        if name in rows and not self.control.runs:
            move = self._prepare_pushed(self._configuration.plant)
            nominal = sensor_of(self._machine.plant, name)
            start.judge(nominal, move, self._machine.form_of(rows[name]), self._command)
        return start

    def _start_of(self, plant: Plant) -> Start:
        """Return initial position and velocity, corrected for the sensor's zero, m and m/s."""
        start = self._start
        if start is None:
            return AT_REST
        sensor = sensor_of(plant, start.name)
        if not start.fitted or self.linear:
            return start.find(sensor, None)
        return self._starts.recall(
            self._key(plant), lambda: start.find(sensor, self._prepare_pushed(plant))
        )

    @property
    def may_be_linear(self) -> bool:
        """Whether errors of the initial state may be corrected to first order, and have to be."""
        return self._start is not None and self._start.may_be_linear

    # Mechanics

    def mechanics(self, plant: Plant) -> tuple[Guide, Inertia]:
        """Return guide and inertia of the joint as compiled code takes them."""
        replay, joint = self._replay, self._replay.joint
        guide = Guide() if replay.guide is None else component_of(plant, replay.guide, Guide)
        mass = 0.0 if replay.mass is None else component_of(plant, replay.mass, Mass).mass
        if replay.mass is not None or replay.rotor is not None:
            mass += self._armature(plant)
        load = self._gravity_load(plant)
        spacing = (joint.positions[-1] - joint.positions[0]) / max(len(joint.gravity) - 1, 1)
        # Overrides may hold whole numbers, and a compiled function is compiled again for each mix
        # of types.
        guide = Guide(*(float(value) for value in guide))
        mass = max(float(mass), LIGHTEST)
        return guide, Inertia(mass, joint.positions[0], spacing, load, joint.goes_round)

    def _gravity_load(self, plant: Plant) -> Array:
        """Return the gravity load at the joint's positions, N or Nm.

        The mass of a hinge's body scales it. What is added to a slide has a weight of its own, even
        where a counterweight balances the rest. A rotor (armature) has no weight.
        """
        joint, load = self._replay.joint, np.array(self._replay.joint.gravity)
        nominal = joint.inertia - joint.armature
        if self._replay.mass is None or nominal <= 0.0:
            return load
        mass = component_of(plant, self._replay.mass, Mass).mass
        return load * (mass / nominal) if joint.turns else load + (mass - nominal) * joint.pull

    def _armature(self, plant: Plant) -> float:
        """Return the inertia of the rotor behind its gear, kg or kg m²."""
        rotor, joint = self._replay.rotor, self._replay.joint
        return joint.armature if rotor is None else component_of(plant, rotor, Rotor).inertia

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that the motion depends on, as a key of remembered motions."""
        replay = self._replay
        names = [replay.guide, replay.mass, replay.rotor, self.mover.name, "computer"]
        names += [*self._schedules, *self._warming, *self.control.sensors]
        if self._start is not None and self._start.name not in names:
            names.append(self._start.name)
        return select(plant, [name for name in names if name is not None])

    # Motion

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
        if force is None and shift is None:
            return self._last.recall(self._key(plant), lambda: self._move(plant, None, None))
        return self._move(plant, force, shift)

    def _move(self, plant: Plant, force: Array | None, shift: Array | None) -> Array:
        if self.pushed:
            disturbance = np.zeros(len(self._command)) if force is None else force
            moved = clip_diverged(self.integrate_pushed(plant, disturbance))
            if not self.linear or self._start is None:
                return moved
            return self._start.correct(sensor_of(plant, self._start.name), moved)
        if self.mover.component_type is PositionActuator:
            mover = component_of(plant, self.mover.name, PositionActuator)
            position = follow_command(
                mover, self._command, plant.computer.delay, self._period, self._steps
            )
            error = 0.0
        else:
            sensor = sensor_of(plant, self.mover.name)
            position = self._undo_sensor(sensor)[:: self.every]
            error = self.error / max(sensor.gain, 1e-9)
        out = self._inverse_dynamics(plant, position if shift is None else position + shift, error)
        if force is not None:
            out[2] -= force
        return clip_diverged(out)

    def _undo_sensor(self, sensor: Sensor) -> Array:
        """Return the position behind the measured motion, m, shape (ticks,)."""
        assert self.smoothed is not None
        return self._integrate(recover_motion(sensor, self.smoothed.motion, self._period))

    def _integrate(self, signal: Array) -> Array:
        """Return the position of an ideal sensor's signal, m, shape (ticks,).

        A measured velocity is integrated without its mean: that is the sensor's offset, as a tested
        joint does not move away.
        """
        return np.cumsum(signal - np.mean(signal)) * self._period if self.integrated else signal

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
        return self._inverse_dynamics(plant, self._integrate(signal), 0.0)

    def _inverse_dynamics(self, plant: Plant, position: Array, error: float) -> Array:
        """Return `move` of a prescribed position, m, whose standard error is `error`, m."""
        velocity = np.gradient(position, self.interval)
        acceleration = np.gradient(velocity, self.interval)
        out = np.zeros((4, len(position)))
        out[0], out[1] = position, velocity
        # Nobody asks for the force: skip it.
        if all(row.kind in ("position", "velocity") for row in self._replay.rows):
            return out
        motion = np.ascontiguousarray(np.stack([position, velocity, acceleration]))
        out[2] = self.required_force(plant, motion, error)
        stroke = max(float(np.ptp(position)), 1e-12)
        spring = 1.0 / max(ELASTIC * error, 1e-9 * stroke)
        for name, recorded in self._schedules.items():
            schedule = component_of(plant, name, Schedule)
            level = follow(schedule, recorded, self._period)[:: self.every]
            out[2] += scheduled_force(schedule, level, motion, spring)
        for name in self._warming:
            warming = component_of(plant, name, Warming)
            if warming.coulomb != 0.0 or warming.viscous != 0.0:
                level = warming.fade(len(position), self.interval)
                out[2] += scheduled_force(warming.schedule, level, motion, spring)
        return out

    def required_force(self, plant: Plant, motion: Array, error: float) -> Array:
        """Return the force that a motion requires of a joint without schedules, N, shape (ticks,).

        Parameters
        ----------
        plant
            Components of the machine.
        motion
            Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
        error
            Standard error of the position, m.
        """
        guide, inertia = self.mechanics(plant)
        force = np.zeros(motion.shape[1])
        spring = 1.0 / self._softest(guide, inertia, motion[0], motion[2], error)
        guide_step = guide_step_of(guide, spring, self._replay.joint.rest, self.interval)
        inverse_dynamics(guide_step, inertia, motion, force)
        return force

    def _softest(
        self, guide: Guide, inertia: Inertia, position: Array, acceleration: Array, error: float
    ) -> float:
        """Return the compliance in series with dry friction, m/N; see `softest_contact`."""
        stretch = position - self._replay.joint.rest
        carried_load = inertia.mass * acceleration + guide.stiffness * stretch
        return softest_contact(guide, carried_load, position, error)

    def integrate_pushed(
        self, plant: Plant, disturbance: Array, noise: Array | None = None
    ) -> Array:
        """Return `move` of a pushed joint, shape (4, ticks).

        Parameters
        ----------
        plant
            Components of the machine.
        disturbance
            Unmodelled force, N, shape (ticks,).
        noise
            Noise of the controller's inputs, shape (ticks, inputs). Default: none.
        """
        return self._prepare_pushed(plant, noise)(self._start_of(plant), disturbance)

    def _prepare_pushed(
        self, plant: Plant, noise: Array | None = None
    ) -> Callable[[Start, Array], Array]:
        """Return a function that integrates the joint.

        Its arguments are the initial state and a disturbance, N, shape (ticks,), whose length is
        the number of ticks.
        """
        guide, inertia = self.mechanics(plant)
        mover = pusher_of(plant, self.mover.name)
        play = play_of(mover)
        steps = self._steps * (CONTACT_STEPS if play.half > 0.0 else 1)
        h = self._period / steps
        guide = soften_stops(guide, inertia.mass, h)
        # Dry friction without a spring of its own gets the stiffest one that the step resolves.
        rigid = RIGID * inertia.mass / h**2
        spring = rigid if guide.compliance <= 0.0 else min(1.0 / guide.compliance, rigid)
        guide_step = guide_step_of(guide, spring, self._replay.joint.rest, h)
        law, conditioning = self._law(plant), actuator(mover, plant.computer, h)

        def integrate(start: Start, disturbance: Array) -> Array:
            out = np.zeros((4, len(disturbance)))
            out[3] = self._command[: len(disturbance)]
            integrate_pushed(
                guide_step=guide_step,
                inertia=inertia,
                start=start,
                drive=Drive(law, conditioning, hold(conditioning, float(self._command[0])), play),
                loop=self.control.loop(plant, self._period, noise),
                disturbance=np.ascontiguousarray(disturbance),
                period=self._period,
                steps=steps,
                out=out,
            )
            return out

        return integrate

    def _law(self, plant: Plant) -> Push:
        """Return the law of the actuator.

        The encoder of a servo is the one in the log, with the same error.
        """
        components = self._machine.components
        encoders = [row.name for row in self._replay.rows if row.kind == "position"]
        encoders += [n for n in self.control.sensors if components[n].quantity == "position"]
        zero = sensor_of(plant, encoders[0]).offset if encoders else 0.0
        return push_law(pusher_of(plant, self.mover.name), zero)

    def recorded_push(self, plant: Plant, position: Array, velocity: Array) -> Array:
        """Return the force of the recorded command along a motion, N, shape (ticks,).

        Parameters
        ----------
        plant
            Components of the machine.
        position, velocity
            Motion of the joint, m and m/s, shape (ticks,).
        """
        # The recorded command, in closed loop too: it is the one that moved the joint.
        assert self.mover.channel is not None
        commanded = np.ascontiguousarray(self._signals.column(*self.mover.channel))
        mover = pusher_of(plant, self.mover.name)
        conditioning = actuator(mover, plant.computer, self._period)
        command = np.zeros(len(position))
        condition_all(conditioning, hold(conditioning, float(commanded[0])), commanded, 1, command)
        return push_all(self._law(plant), command, position, velocity)
