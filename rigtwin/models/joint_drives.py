"""Inputs of coupled joints at all integration steps: prescribed motions, forces, servos, guides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from rigtwin.components import (
    UNLIMITED,
    ForceActuator,
    Guide,
    PositionActuator,
    component_of,
)
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.dry_friction import Friction, friction, friction_size
from rigtwin.components.end_stops import soften_stops
from rigtwin.components.guide import acts
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of
from rigtwin.components.servo import Play, Push, play_of, pusher_of
from rigtwin.description.machine import Machine
from rigtwin.models.following import follow_command
from rigtwin.models.forward_arrays import GuideContacts, Pushers, StepInputs
from rigtwin.models.joint_layout import JointLayout
from rigtwin.models.joint_motion import RIGID
from rigtwin.models.joint_simulation import CONTACT_STEPS
from rigtwin.models.measured_motion import ELASTIC, recover_motion
from rigtwin.numerics.arrays import Array, interpolate, to_records
from rigtwin.recording import Inputs
from rigtwin.signals.motion import SmoothedMotion


def recorded(machine: Machine, signals: Inputs, name: str) -> Array:
    """Return the recorded signal of a component, shape (ticks,)."""
    channel = machine.components[name].channel
    assert channel is not None
    return signals.column(*channel)


class JointDrives:
    """What drives coupled joints in one recording, as compiled code takes it.

    Parameters
    ----------
    machine, layout
        Machine, and its components in the coordinates of the joints.
    signals
        Recorded commands.
    motions
        Sensor that prescribes a motion → smoothed signal, m, shape (ticks,), and its error, m.
    loosest
        Smallest inertia that each guide can feel, kg, shape (guides,).
    steps
        Integration steps per tick.

    Attributes
    ----------
    steps : int
        Integration steps per tick.
    """

    def __init__(
        self,
        machine: Machine,
        layout: JointLayout,
        signals: Inputs,
        motions: Mapping[str, SmoothedMotion],
        loosest: Array,
        steps: int,
    ) -> None:
        self._machine, self._layout, self._signals = machine, layout, signals
        self._read, self._loosest, self.steps = motions, loosest, steps
        self._period, self._ticks = signals.period, signals.ticks
        # Zeros that nobody writes to serve all predictions.
        self._undisturbed = (
            np.zeros((layout.bodies.coordinates, self._ticks)),
            np.zeros((len(layout.guides), self._ticks)),
        )

    def resolve(self, plant: Plant) -> JointDrives:
        """Return the drives with steps that are short enough for a plant.

        The impact of two teeth takes a few ms.
        """
        if not self._rotors(plant):
            return self
        finer = copy(self)
        finer.steps = CONTACT_STEPS * self.steps
        return finer

    def prescribe(self, plant: Plant, shifts: Mapping[str, Array]) -> Array:
        """Return the prescribed positions at the steps, m, shape (coordinates, steps + 1).

        `shifts` maps a sensor to a displacement of its measured motion, m, shape (ticks,).
        """
        count = self._ticks * self.steps + 1
        positions = np.zeros((self._layout.bodies.coordinates, count))
        time = np.arange(self._ticks + 1) * self._period
        fine = np.arange(count) * (self._period / self.steps)
        for place, name in zip(self._layout.held, self._layout.leaders, strict=True):
            if name in self._read:
                signal = self._read[name][0] + shifts.get(name, 0.0)
                position = recover_motion(sensor_of(plant, name), signal, self._period)
            else:
                mover = component_of(plant, name, PositionActuator)
                late, command = plant.computer.delay, recorded(self._machine, self._signals, name)
                position = follow_command(mover, command, late, self._period, self.steps)
            position = (position - self._layout.zero[name]) / self._layout.along[name][place]
            # The last step needs a position beyond the last tick: extrapolated.
            position = np.append(position, 2.0 * position[-1] - position[-2])
            positions[place] = position if self.steps == 1 else interpolate(time, position, fine)
        return positions

    def condition(self, plant: Plant, names: Sequence[str]) -> Array:
        """Return conditioned commands of actuators at the steps, shape (actuators, steps)."""
        commands = np.zeros((len(names), self._ticks * self.steps))
        for number, name in enumerate(names):
            command = np.ascontiguousarray(recorded(self._machine, self._signals, name))
            mover = pusher_of(plant, name)
            conditioning = actuator(mover, plant.computer, self._period / self.steps)
            condition_all(
                conditioning,
                hold(conditioning, float(command[0])),
                command,
                self.steps,
                commands[number],
            )
        return commands

    def load(self, plant: Plant) -> float:
        """Return the rms force of all force actuators together, N."""
        forces = []
        for name in self._layout.pushers:
            mover = pusher_of(plant, name)
            if isinstance(mover, ForceActuator):
                limit = min(mover.force_limit, UNLIMITED)
                command = self.condition(plant, [name])[0]
                forces.append(np.clip(mover.constant * command, -limit, limit))
        return float(np.sqrt(np.mean(np.square(forces)))) if forces else 0.0

    def serve(self, plant: Plant) -> Pushers:
        """Return the actuators with their conditioned commands at the steps."""
        names = self._layout.pushers
        laws = [self._layout.push_law(plant, name) for name in names]
        return Pushers(
            laws=to_records(Push, laws),
            plays=to_records(Play, [play_of(pusher_of(plant, name)) for name in names]),
            levers=self._layout.directions(names),
            zero=np.array([self._layout.zero[name] for name in names]),
            inertia=np.array([self.inertia_along(self._layout.along[name]) for name in names]),
            commands=self.condition(plant, names),
        )

    def collect(self, plant: Plant, shifts: Mapping[str, Array]) -> StepInputs:
        """Return the inputs of one test without disturbances.

        `shifts` displace measured motions, as in `prescribe`.
        """
        return StepInputs(
            prescribed=self.prescribe(plant, shifts),
            disturbance=self._undisturbed[0],
            guide_disturbance=self._undisturbed[1],
            pushers=self.serve(plant),
        )

    def contacts(self, plant: Plant) -> GuideContacts:
        """Return the guides as compiled code takes them.

        The forces of the actuators give the load by which the friction of a prescribed joint is
        sized.
        """
        layout = self._layout
        # Rigid dry friction has no spring of its own. A numerical one is as stiff as the step
        # resolves; it keeps the friction single-valued, so that a sticking joint stays put.
        h = self._period / self.steps
        felt = self._loosest.copy()
        for along, inertia in self._rotors(plant):
            for number, name in enumerate(layout.guides):
                if np.array_equal(layout.along[name], along):
                    felt[number] -= inertia
        guides = [
            soften_stops(component_of(plant, name, Guide), float(mass), h)
            for name, mass in zip(layout.guides, felt, strict=True)
        ]
        dry = [friction(guide) for guide in guides]
        springs = np.empty(len(guides))
        for number, (name, guide) in enumerate(zip(layout.guides, guides, strict=True)):
            rigid = RIGID * felt[number] / h**2
            # A fully prescribed guide must not see its friction jump with the sensor's noise: its
            # spring builds the friction up over the error of the measured motion.
            if not layout.along[name][layout.free].any():
                size = max(friction_size(dry[number], self.load(plant)), 1e-300)
                errors = np.array(
                    [self._read[n][1] if n in self._read else 0.0 for n in layout.leaders]
                )
                error = float(np.linalg.norm(layout.along[name][layout.held] * errors))
                rigid = 1.0 / max(ELASTIC * error / size, 1e-12 / size)
            springs[number] = (
                rigid if guide.compliance <= 0.0 else min(1.0 / guide.compliance, rigid)
            )
        return GuideContacts(
            guides=to_records(Guide, guides),
            dry=to_records(Friction, dry),
            along=layout.directions(layout.guides),
            zero=np.array([layout.zero[name] for name in layout.guides]),
            springs=springs,
            rests=np.array(
                [layout.bodies.rest_of(self._machine.components[name]) for name in layout.guides]
            ),
            inertia=felt,
            acts=np.array([acts(guide) for guide in guides], bool),
            rubs=np.array([friction_size(each, 1.0) > 0.0 for each in dry], bool),
        )

    def turning(self, plant: Plant) -> Array:
        """Return the inertia matrix of the rotors that turn with the joints, kg.

        Its shape is (coordinates, coordinates). A rotor behind a play moves by itself, so that the
        joint lacks its inertia.
        """
        matrix = self._layout.turning(plant)
        for along, inertia in self._rotors(plant):
            matrix -= inertia * np.outer(along, along)
        return matrix

    def _rotors(self, plant: Plant) -> list[tuple[Array, float]]:
        """Return direction and inertia of each motor's rotor that is behind a play."""
        directions = [self._layout.along[name] for name in self._layout.pushers]
        plays = [play_of(pusher_of(plant, name)) for name in self._layout.pushers]
        return [
            (along, play.rotor_share * self.inertia_along(along))
            for along, play in zip(directions, plays, strict=True)
            if play.half > 0.0
        ]

    def inertia_along(self, along: Array) -> float:
        """Return the inertia along a direction, kg or kg m², by the guide that has it."""
        for number, name in enumerate(self._layout.guides):
            if np.array_equal(self._layout.along[name], along):
                return float(self._loosest[number])
        return float(np.max(self._loosest)) if len(self._loosest) else 1.0
