"""The bodies of an MJCF as joints that act on each other feel them: inertia matrix and the forces
of gravity and of velocities, by MuJoCo, at any motion.

Coordinates are those of the joints that move. A joint that an equality ties to one of them goes
with it; all others stay where the MJCF has them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from rigtwin.description.machine import Component
from rigtwin.description.mechanism import Mechanism, compile_model
from rigtwin.models.rigid import list_nominal, strip
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import fwd_position, fwd_velocity, kernel

UNCHANGED = 1e-9
"""Share of its size by which an inertia matrix that is the same everywhere may differ."""
PLACES = 5
"""Places at which that is looked for."""


class Bodies(NamedTuple):
    """What compiled code needs of them. model, data: addresses of MuJoCo's; places, dofs: of the
    joints that move, in its vectors; ties: how far each of them goes for each coordinate's unit,
    shape (joints, coordinates), from `base`; qpos, qvel, bias, passive: its vectors; entries,
    columns, first, entered: its inertia matrix, a row's entries; added: inertia besides, of what
    turns with the motors, shape (coordinates, coordinates); steady: whether inertia and bias are
    the same everywhere; inertia, constant: then they are these, `added` not among them."""

    model: int
    data: int
    places: np.ndarray
    dofs: np.ndarray
    ties: Array
    base: Array
    qpos: Array
    qvel: Array
    bias: Array
    passive: Array
    entries: Array
    columns: np.ndarray
    first: np.ndarray
    entered: np.ndarray
    added: Array
    steady: bool
    inertia: Array
    constant: Array


@kernel
def find_terms(bodies: Bodies, place: Array, speed: Array, inertia: Array, bias: Array) -> None:
    """Inertia matrix and bias of the coordinates.

    Parameters
    ----------
    bodies
        That move.
    place, speed
        Of the coordinates, shape (coordinates,).
    inertia, bias
        Written here, shape (coordinates, coordinates) and (coordinates,): force = inertia ·
        acceleration + bias.
    """
    if bodies.steady:
        inertia[:] = bodies.inertia + bodies.added
        bias[:] = bodies.constant
        return
    size = len(place)
    for joint in range(len(bodies.dofs)):
        at, rate = bodies.base[joint], 0.0
        for own in range(size):
            at += bodies.ties[joint, own] * place[own]
            rate += bodies.ties[joint, own] * speed[own]
        bodies.qpos[bodies.places[joint]] = at
        bodies.qvel[bodies.dofs[joint]] = rate
    fwd_position(bodies.model, bodies.data)
    fwd_velocity(bodies.model, bodies.data)
    inertia[:] = bodies.added
    bias[:] = 0.0
    for joint in range(len(bodies.dofs)):
        row = bodies.dofs[joint]
        force = bodies.bias[row] - bodies.passive[row]
        for own in range(size):
            bias[own] += bodies.ties[joint, own] * force
        start = bodies.first[row]
        for entry in range(start, start + bodies.entered[row]):
            value = bodies.entries[entry]
            for other in range(len(bodies.dofs)):
                if bodies.dofs[other] != bodies.columns[entry]:
                    continue
                for i in range(size):
                    for j in range(size):
                        both = bodies.ties[joint, i] * bodies.ties[other, j]
                        if other != joint:
                            both += bodies.ties[other, i] * bodies.ties[joint, j]
                        inertia[i, j] += both * value


def inertia_at(bodies: Bodies, place: Array) -> Array:
    """The inertia matrix at a place, shape (coordinates, coordinates)."""
    size = len(place)
    inertia, bias = np.empty((size, size)), np.empty(size)
    find_terms(bodies, place, np.zeros(size), inertia, bias)
    return inertia


class Multibody:
    """The bodies without what the description's components stand for: friction, springs and rotors
    of joints and tendons. No contacts, no stops."""

    def __init__(
        self,
        path: Path,
        joints: Sequence[str],
        guides: Sequence[Component],
        rotors: Sequence[Component],
    ) -> None:
        """joints: whose positions are the coordinates; guides, rotors: components that are worked
        out elsewhere. Raises RigtwinError if the model cannot be read."""
        self._path, self._guides, self._rotors = path, guides, rotors
        mechanism = Mechanism(path)
        self._model = self._prepare(mechanism.model)
        names = list(joints)
        ties, base = np.eye(len(joints)), np.zeros(len(joints))
        for tie in mechanism.ties_of(joints)[0]:
            place = names.index(tie.to)
            ties = np.vstack([ties, tie.ratio * ties[place]])
            base = np.append(base, tie.offset + tie.ratio * base[place])
            names.append(tie.joint)
        self._ties, self._from, self._tied = ties, base, names
        self._numbers = [mechanism.number("joint", name) for name in names]
        self.coordinates = len(joints)
        self._find_steady()

    def express(self, acts_on: Sequence[tuple[str, float]]) -> Array:
        """A coordinate that goes so far for each unit of some joints, by those that are free to
        move: shape (coordinates,)."""
        found = np.zeros(self.coordinates)
        for joint, coefficient in acts_on:
            if joint in self._tied:
                found += coefficient * self._ties[self._tied.index(joint)]
        return found

    def measure(self, acts_on: Sequence[tuple[str, float]]) -> float:
        """Where that coordinate is while all others are at zero."""
        found = 0.0
        for joint, coefficient in acts_on:
            if joint in self._tied:
                found += coefficient * float(self._from[self._tied.index(joint)])
            else:
                number = self._model.joint(joint).id
                found += coefficient * float(self._model.qpos0[self._model.jnt_qposadr[number]])
        return found

    def rest_of(self, component: Component) -> float:
        """Where the spring of a joint or a tendon is slack, along its own coordinate."""
        model = self._model
        if component.element == "tendon":
            return float(np.mean(model.tendon_lengthspring[model.tendon(component.mjcf).id]))
        return float(model.qpos_spring[model.jnt_qposadr[model.joint(component.mjcf).id]])

    def place(self) -> Array:
        """Where the MJCF has the coordinates, shape (coordinates,)."""
        at = self._model.jnt_qposadr[self._numbers[: self.coordinates]]
        return np.array(self._model.qpos0[at])

    def list_nominal(self, name: str) -> tuple[float, Array, Array]:
        """What the MJCF says of a body alone."""
        return list_nominal(self._model, name)

    def change(
        self, parameters: Mapping[str, Array], gravity: Callable[[Array], Array] | None
    ) -> Multibody:
        """The same with other bodies.

        Parameters
        ----------
        parameters
            Body → its ten inertial parameters, as `components.body.INERTIAL`, shape (10,).
        gravity
            What becomes of gravity, m/s², shape (3,).

        Returns
        -------
        Multibody
            With these.
        """

        turned = np.empty(4)

        def alter(spec: mujoco.MjSpec) -> None:
            for name, (mass, mx, my, mz, *moments) in parameters.items():
                body, centre = spec.body(name), np.array([mx, my, mz]) / mass
                shifted = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
                about = arrange_moments(moments) - shifted
                principal, axes = np.linalg.eigh(about)
                axes[:, 2] *= np.linalg.det(axes)
                mujoco.mju_mat2Quat(turned, np.ascontiguousarray(axes).ravel())
                body.explicitinertial = True
                body.mass, body.ipos, body.iquat = mass, centre, turned
                # A rounding below nothing is nothing.
                body.inertia = np.maximum(principal, 1e-15)
                body.fullinertia = np.full(6, np.nan)
            if gravity is not None:
                spec.option.gravity = gravity(np.array(spec.option.gravity))

        found = copy(self)
        found._model = self._prepare(compile_model(self._path, alter))
        found._find_steady()
        return found

    def scale(self, shares: Mapping[str, float]) -> Multibody:
        """The same with bodies that are so many times as heavy. shares: of all that each joint
        carries."""
        found = copy(self)
        found._model = model = copy(self._model)
        for joint, share in shares.items():
            carried = [int(model.jnt_bodyid[model.joint(joint).id])]
            for body in range(carried[0] + 1, model.nbody):
                if model.body_parentid[body] in carried:
                    carried.append(body)
            model.body_mass[carried] *= share
            model.body_inertia[carried] *= share
        mujoco.mj_setConst(model, mujoco.MjData(model))
        found._find_steady()
        return found

    def _prepare(self, model: mujoco.MjModel) -> mujoco.MjModel:
        model.opt.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        )
        strip(model, self._guides, self._rotors)
        # Bodies that move simply have an inertia of their own there, worked out beforehand.
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def _find_steady(self) -> None:
        """Whether inertia and bias are the same wherever the joints are and however they go."""
        random = np.random.default_rng(PLACES)
        size = self.coordinates
        self._steady: Array | None = None
        found = []
        data = self.data()
        bodies = self.bodies(data)
        for _ in range(PLACES):
            inertia, bias = np.empty((size, size)), np.empty(size)
            place, speed = random.uniform(-1.0, 1.0, size), random.uniform(-1.0, 1.0, size)
            find_terms(bodies, place, speed, inertia, bias)
            found.append(np.column_stack([inertia, bias]))
        apart = np.max(np.ptp(np.stack(found), axis=0))
        if apart <= UNCHANGED * np.max(np.abs(found[0])):
            self._steady = found[0]

    def data(self) -> mujoco.MjData:
        """MuJoCo's own for these bodies, of one caller alone."""
        return mujoco.MjData(self._model)

    def bodies(self, data: mujoco.MjData, added: Array | None = None) -> Bodies:
        """For compiled code, which knows data by its address only: keep it for as long. added:
        inertia besides, shape (coordinates, coordinates)."""
        model, size, steady = self._model, self.coordinates, self._steady
        return Bodies(
            model=model._address,
            data=data._address,
            places=np.array([model.jnt_qposadr[n] for n in self._numbers], np.int64),
            dofs=np.array([model.jnt_dofadr[n] for n in self._numbers], np.int64),
            ties=self._ties,
            base=self._from,
            qpos=data.qpos,
            qvel=data.qvel,
            bias=data.qfrc_bias,
            passive=data.qfrc_passive,
            entries=data.M,
            columns=np.array(model.M_colind, np.int64),
            first=np.array(model.M_rowadr, np.int64),
            entered=np.array(model.M_rownnz, np.int64),
            added=np.zeros((size, size)) if added is None else added,
            steady=steady is not None,
            inertia=np.zeros((size, size)) if steady is None else steady[:, :-1].copy(),
            constant=np.zeros(size) if steady is None else steady[:, -1].copy(),
        )


def arrange_moments(moments: Sequence[float]) -> Array:
    """The matrix of ixx, iyy, izz, ixy, ixz, iyz."""
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
