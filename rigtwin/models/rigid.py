"""The forces that a mechanism's bodies take to move as prescribed, by MuJoCo's inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path

import mujoco
import numpy as np

from rigtwin.components.body import INERTIAL, Base, turn_gravity
from rigtwin.description.machine import Component
from rigtwin.description.mechanism import compile_model
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import inverse, kernel


@kernel
def _invert(
    model: int,
    data: int,
    places: np.ndarray,
    dofs: np.ndarray,
    qpos: Array,
    qvel: Array,
    qacc: Array,
    found: Array,
    motion: Array,
    out: Array,
) -> None:
    """places, dofs: of the joints that move, in MuJoCo's vectors, which qpos, qvel, qacc and found
    are; motion: shape (3, joints, ticks); out: shape (joints, ticks)."""
    for tick in range(motion.shape[2]):
        for joint in range(len(dofs)):
            qpos[places[joint]] = motion[0, joint, tick]
            qvel[dofs[joint]] = motion[1, joint, tick]
            qacc[dofs[joint]] = motion[2, joint, tick]
        inverse(model, data)
        for joint in range(len(dofs)):
            out[joint, tick] = found[dofs[joint]]


HEAVIER = 100.0
"""kg or kg m² at every joint while what a body adds is worked out."""
ROUNDING = 1e-11
"""Share of the largest force below which a force is rounding."""


def _arrange_unit(unit: Array) -> tuple[float, Array, Array, Array]:
    """Mass, centre, principal moments and their axes, a quaternion, of one of the ten parameters
    alone, or of none; of a first moment, of a mass of 1 kg at 1 m."""
    nothing, straight = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if not unit.any():
        return 0.0, nothing, nothing, straight
    place = int(np.argmax(unit))
    if place == 0:
        return 1.0, nothing, nothing, straight
    if place < 4:
        centre = np.eye(3)[place - 1]
        return 1.0, centre, centre - 1.0, straight
    if place < 7:
        return 0.0, nothing, np.eye(3)[place - 4], straight
    # A product of inertia is a moment along one diagonal and as much less along the other.
    one, other = ((0, 1), (0, 2), (1, 2))[place - 7]
    axes = np.zeros((3, 3))
    axes[[one, other], 0] = axes[other, 1] = np.sqrt(0.5)
    axes[one, 1] = -np.sqrt(0.5)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return 0.0, nothing, np.array([1.0, -1.0, 0.0]), quaternion


def strip(model: mujoco.MjModel, guides: Sequence[Component], rotors: Sequence[Component]) -> None:
    """Takes out of a model what components stand for that are worked out elsewhere: damping and
    springs of guides, inertia of rotors."""
    for component in guides:
        if component.element == "tendon":
            number = model.tendon(component.mjcf).id
            model.tendon_damping[number] = model.tendon_stiffness[number] = 0.0
        else:
            number = model.joint(component.mjcf).id
            model.dof_damping[model.jnt_dofadr[number]] = 0.0
            model.jnt_stiffness[number] = 0.0
    for component in rotors:
        if component.element == "tendon":
            model.tendon_armature[model.tendon(component.mjcf).id] = 0.0
        else:
            model.dof_armature[model.joint(component.mjcf).dofadr[0]] = 0.0


def list_nominal(model: mujoco.MjModel, name: str) -> tuple[float, Array, Array]:
    """What a model says of a body alone: its mass, kg, centre, m, shape (3,), and its inertia about
    that along the frame's axes, kg m², shape (3, 3)."""
    body = model.body(name)
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, body.iquat)
    axes = turned.reshape(3, 3)
    return float(body.mass[0]), np.array(body.ipos), axes @ np.diag(body.inertia) @ axes.T


class RigidBodies:
    """The bodies of an MJCF without what the description's components stand for: friction, springs
    and rotors of joints and tendons. No contacts, stops or equalities."""

    def __init__(
        self,
        path: Path,
        joints: Sequence[str],
        guides: Sequence[Component],
        rotors: Sequence[Component],
    ) -> None:
        """joints: that move; all others stay where the MJCF has them. guides, rotors: components
        that are worked out elsewhere."""
        self._model = model = compile_model(path)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        strip(model, guides, rotors)
        numbers = [model.joint(name).id for name in joints]
        self._gravity = np.array(model.opt.gravity)
        self._places = np.array([model.jnt_qposadr[number] for number in numbers], np.int64)
        self._dofs = np.array([model.jnt_dofadr[number] for number in numbers], np.int64)

    def list_nominal(self, name: str) -> tuple[float, Array, Array]:
        """What the MJCF says of a body alone."""
        return list_nominal(self._model, name)

    def turn(self, base: Base) -> Array:
        """Gravity, m/s², shape (3,), where the base is turned."""
        return turn_gravity(base, self._gravity)

    def regressor(self, motion: Array, name: str, gravity: Array | None = None) -> Array:
        """What each inertial parameter of a body adds to the forces, which are linear in them.

        Parameters
        ----------
        motion
            Positions, velocities and accelerations, shape (3, joints, ticks).
        name
            The body's, in the MJCF.
        gravity
            m/s², shape (3,); by default the MJCF's.

        Returns
        -------
        array
            N or Nm for a kg, kg m or kg m² of each of `INERTIAL`, shape (10, joints, ticks);
            exactly 0 where there is nothing but rounding.
        """
        model = copy(self._model)
        number = model.body(name).id
        # MuJoCo warns of joints that nothing resists; what is the same in all of them cancels out.
        model.dof_armature[:] += HEAVIER
        model.body_sameframe[number] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        found = []
        # A body without mass but the one moment that is meant can be worked out, if not be made.
        for unit in np.eye(len(INERTIAL) + 1)[:, :-1]:
            mass, centre, principal, axes = _arrange_unit(unit)
            model.body_mass[number], model.body_ipos[number] = mass, centre
            model.body_inertia[number], model.body_iquat[number] = principal, axes
            found.append(self._forces(model, motion, gravity))
        without = found.pop()
        columns = np.stack(found) - without
        # A first moment was put in as a mass at 1 m.
        columns[1:4] -= columns[0]
        rounding = ROUNDING * max(float(np.max(np.abs(each))) for each in (columns, without))
        columns[np.max(np.abs(columns), axis=2) < rounding] = 0.0
        return columns

    def forces(self, motion: Array, gravity: Array | None = None) -> Array:
        """The forces on the joints.

        Parameters
        ----------
        motion
            Positions, velocities and accelerations, shape (3, joints, ticks).
        gravity
            m/s², shape (3,); by default the MJCF's.

        Returns
        -------
        array
            N or Nm, shape (joints, ticks).
        """
        return self._forces(self._model, motion, gravity)

    def _forces(self, model: mujoco.MjModel, motion: Array, gravity: Array | None) -> Array:
        if gravity is not None:
            model = copy(model)
            model.opt.gravity = gravity
        data = mujoco.MjData(model)
        out = np.empty(motion.shape[1:])
        _invert(
            model=model._address,
            data=data._address,
            places=self._places,
            dofs=self._dofs,
            qpos=data.qpos,
            qvel=data.qvel,
            qacc=data.qacc,
            found=data.qfrc_inverse,
            motion=np.ascontiguousarray(motion),
            out=out,
        )
        return out
