"""Layout of a machine's components in the coordinates of its coupled joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.components import PUSHERS, Base, Body, Guide, Rotor, component_of
from rigtwin.components.body import list_parameters, list_surplus, turn_gravity
from rigtwin.components.plant import Plant, select
from rigtwin.components.sensors import sensor_of
from rigtwin.components.servo import Push, push_law, pusher_of
from rigtwin.description.component import Component
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf
from rigtwin.models.joint_simulation import KEPT
from rigtwin.models.multibody import Multibody
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.memo import Memo


class JointLayout:
    """Components of a machine in the coordinates of its coupled joints.

    Parameters
    ----------
    machine, replay
        Machine, and the part of it whose joints are coupled.

    Attributes
    ----------
    pushers, leaders : list of str
        Force actuators and servos, and the components that prescribe motion.
    guides, rotors : list of str
        Guides and rotors that some coordinate moves.
    bodies : Multibody
        Nominal rigid bodies.
    along : dict
        Component → its direction in the coordinates, shape (coordinates,).
    zero : dict
        Component → its position at zero coordinates, m.
    encoders : dict
        Servo → position sensor within its loop; None without one.
    free, held : array of int
        Indices of the free coordinates, which come first, and of the prescribed ones.
    """

    def __init__(self, machine: Machine, replay: ReplayOf) -> None:
        components = machine.components
        movers = [(name, components[name].component_type) for name in replay.moved_by]
        self.pushers = [name for name, of in movers if of in PUSHERS]
        self.leaders = [name for name in replay.moved_by if name not in self.pushers]
        joints = [*replay.free, *(components[name].joint for name in self.leaders)]
        guides, rotors = machine.components_of(Guide), machine.components_of(Rotor)
        self.bodies = Multibody(machine.model, joints, guides, rotors)
        self.along = {n: self.bodies.express(c.acts_on) for n, c in components.items()}
        self.zero = {n: self.bodies.measure(c.acts_on) for n, c in components.items()}
        self.guides = [guide.name for guide in guides if self.along[guide.name].any()]
        self.rotors = [rotor.name for rotor in rotors if self.along[rotor.name].any()]
        self.free = np.arange(len(replay.free))
        self.held = np.arange(len(replay.free), len(joints))
        self.encoders = {name: self._encoder_of(components, name) for name in self.pushers}
        self._heavy = {body.name: body.mjcf for body in machine.components_of(Body)}
        self._base = next((base.name for base in machine.components_of(Base)), None)
        self._changed: Memo[Multibody] = Memo(KEPT)

    def _encoder_of(self, components: Mapping[str, Component], servo: str) -> str | None:
        """Return the sensor of the position that a servo controls; None without one."""
        along = self.along[servo]
        return next(
            (
                name
                for name, component in components.items()
                if component.quantity == "position" and np.array_equal(self.along[name], along)
            ),
            None,
        )

    def push_law(self, plant: Plant, pusher: str) -> Push:
        """Return the law of an actuator; a servo's encoder is the one in the log with its error."""
        encoder = self.encoders[pusher]
        zero = 0.0 if encoder is None else sensor_of(plant, encoder).offset
        return push_law(pusher_of(plant, pusher), zero)

    @property
    def inertial(self) -> tuple[str, ...]:
        """Names of the components that change the rigid bodies: links and the base."""
        return (*self._heavy, *(() if self._base is None else (self._base,)))

    def directions(self, names: Sequence[str]) -> Array:
        """Return the directions of components, shape (components, coordinates)."""
        return np.array([self.along[name] for name in names]).reshape(-1, self.bodies.coordinates)

    def turning(self, plant: Plant) -> Array:
        """Return the rotors' inertia matrix Σ J·a·aᵀ, kg, shape (coordinates, coordinates)."""
        size = self.bodies.coordinates
        inertia = np.zeros((size, size))
        for name in self.rotors:
            along, rotor = self.along[name], component_of(plant, name, Rotor)
            inertia += rotor.inertia * np.outer(along, along)
        return inertia

    def bodies_of(self, plant: Plant) -> Multibody:
        """Return the rigid bodies with the plant's inertial parameters and tilt of the base."""
        # A change of bodies recompiles the MJCF, so the last few variants are remembered.
        key = select(plant, self.inertial)
        return self._changed.recall(key, lambda: self._change_bodies(plant))

    def _change_bodies(self, plant: Plant) -> Multibody:
        changed = {}
        for name, mjcf in self._heavy.items():
            body = component_of(plant, name, Body)
            nominal = self.bodies.list_nominal(mjcf)
            if list_surplus(body, *nominal).any():
                changed[mjcf] = list_parameters(body, nominal[0], nominal[2])
        base = None if self._base is None else component_of(plant, self._base, Base)
        if not changed and (base is None or not any(base)):
            return self.bodies
        turn = None if base is None else (lambda gravity: turn_gravity(base, gravity))
        return self.bodies.change(changed, turn)
