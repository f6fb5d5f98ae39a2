"""Inverse dynamics of a mechanism's rigid bodies, by MuJoCo: τ = M(q)·q'' + c(q, q')."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path

import mujoco
import numpy as np

from rigtwin.components.body import INERTIAL, Base, turn_gravity
from rigtwin.description.component import Component
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
    forces: Array,
    motion: Array,
    out: Array,
) -> None:
    """Compute the joints' forces tick by tick.

    Parameters
    ----------
    model, data
        Addresses of MuJoCo's model and data.
    places, dofs
        Indices of the moving joints in `qpos` and in the vectors of velocities, shape (joints,).
    qpos, qvel, qacc, forces
        Vectors of the data: positions, velocities, accelerations, and the result.
    motion
        Positions, velocities and accelerations, shape (3, joints, ticks).
    out
        Forces, written, N or Nm, shape (joints, ticks).
    """
    for tick in range(motion.shape[2]):
        for joint in range(len(dofs)):
            qpos[places[joint]] = motion[0, joint, tick]
            qvel[dofs[joint]] = motion[1, joint, tick]
            qacc[dofs[joint]] = motion[2, joint, tick]
        inverse(model, data)
        for joint in range(len(dofs)):
            out[joint, tick] = forces[dofs[joint]]


HEAVIER = 100.0
"""Inertia added to every joint while the regressor is computed, kg or kg m²."""
ROUNDING = 1e-11
"""Share of the largest force below which a force counts as rounding error."""


def _arrange_unit(unit: Array) -> tuple[float, Array, Array, Array]:
    """Return the MuJoCo body that has one inertial parameter of 1 and all others 0.

    `unit` is a row of the identity matrix, shape (10,), or zero for a body without mass. A first
    moment of 1 kg m is made by 1 kg at 1 m; the caller subtracts the mass. The result is mass,
    centre, principal moments and the quaternion of their axes.
    """
    zeros, straight = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if not unit.any():
        return 0.0, zeros, zeros, straight
    place = int(np.argmax(unit))
    if place == 0:
        return 1.0, zeros, zeros, straight
    if place < 4:
        # Moments of −1 about the two normal axes cancel the parallel-axis term of the point mass.
        centre = np.eye(3)[place - 1]
        return 1.0, centre, centre - 1.0, straight
    if place < 7:
        return 0.0, zeros, np.eye(3)[place - 4], straight
    # A product of inertia has principal moments ±1 along the diagonals of its plane.
    first, second = ((0, 1), (0, 2), (1, 2))[place - 7]
    axes = np.zeros((3, 3))
    axes[[first, second], 0] = axes[second, 1] = np.sqrt(0.5)
    axes[first, 1] = -np.sqrt(0.5)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return 0.0, zeros, np.array([1.0, -1.0, 0.0]), quaternion


def strip(model: mujoco.MjModel, guides: Sequence[Component], rotors: Sequence[Component]) -> None:
    """Remove from a model what components describe: damping and springs, inertia of rotors.

    Parameters
    ----------
    model
        MuJoCo model, changed in place.
    guides
        Guides, whose damping and springs are removed from their joints or tendons.
    rotors
        Rotors, whose inertia (armature) is removed.
    """
    for component in guides:
        if component.element == "tendon":
            number = model.tendon(component.mjcf).id
            model.tendon_damping[number] = model.tendon_stiffness[number] = 0.0
            model.tendon_dampingpoly[number] = model.tendon_stiffnesspoly[number] = 0.0
        else:
            number = model.joint(component.mjcf).id
            model.dof_damping[model.jnt_dofadr[number]] = 0.0
            model.dof_dampingpoly[model.jnt_dofadr[number]] = 0.0
            model.jnt_stiffness[number] = model.jnt_stiffnesspoly[number] = 0.0
    for component in rotors:
        if component.element == "tendon":
            model.tendon_armature[model.tendon(component.mjcf).id] = 0.0
        else:
            model.dof_armature[model.joint(component.mjcf).dofadr[0]] = 0.0


def rest_of(model: mujoco.MjModel, component: Component) -> float:
    """Return the position at which the spring of a joint or tendon is slack, m or rad.

    Parameters
    ----------
    model
        MuJoCo model.
    component
        Guide at a joint or a fixed tendon.
    """
    if component.element == "tendon":
        return float(np.mean(model.tendon_lengthspring[model.tendon(component.mjcf).id]))
    return float(model.qpos_spring[model.jnt_qposadr[model.joint(component.mjcf).id]])


def list_nominal(model: mujoco.MjModel, name: str) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and inertia of a body in the model.

    Parameters
    ----------
    model
        MuJoCo model.
    name
        Name of the body.

    Returns
    -------
    tuple
        Mass, kg; centre of mass in the body's frame, m, shape (3,); inertia about the centre of
        mass along the frame's axes, kg m², shape (3, 3).
    """
    body = model.body(name)
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, body.iquat)
    axes = turned.reshape(3, 3)
    return float(body.mass[0]), np.array(body.ipos), axes @ np.diag(body.inertia) @ axes.T


class RigidBodies:
    """Rigid bodies without the friction, springs and rotors that components describe.

    Contacts, joint limits and equalities of the MJCF are switched off.

    Parameters
    ----------
    path
        MJCF of the machine.
    joints
        Joints that move; all others stay where the MJCF has them.
    guides, rotors
        Components whose friction, springs and inertia are modelled elsewhere.
    """

    def __init__(
        self,
        path: Path,
        joints: Sequence[str],
        guides: Sequence[Component],
        rotors: Sequence[Component],
    ) -> None:
        self._model = model = compile_model(path)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        strip(model, guides, rotors)
        numbers = [model.joint(name).id for name in joints]
        self._gravity = np.array(model.opt.gravity)
        self._places = np.array([model.jnt_qposadr[number] for number in numbers], np.int64)
        self._dofs = np.array([model.jnt_dofadr[number] for number in numbers], np.int64)

    def rest_of(self, component: Component) -> float:
        """Return the position at which a guide's spring is slack; see `rest_of`."""
        return rest_of(self._model, component)

    def list_nominal(self, name: str) -> tuple[float, Array, Array]:
        """Return mass, centre of mass and inertia of a body in the MJCF; see `list_nominal`."""
        return list_nominal(self._model, name)

    def turn(self, base: Base) -> Array:
        """Return gravity in the frame of a tilted base, m/s², shape (3,)."""
        return turn_gravity(base, self._gravity)

    def regressor(self, motion: Array, name: str, gravity: Array | None = None) -> Array:
        """Return the regressor Y of a body: its forces per unit of each inertial parameter.

        Forces are linear in the inertial parameters π of a body, τ = Y(q, q', q'')·π (Atkeson, An
        and Hollerbach, International Journal of Robotics Research 5(3), 1986). Each column is one
        inverse dynamics with a unit parameter, less that of a body without mass.

        Parameters
        ----------
        motion
            Positions, velocities and accelerations, shape (3, joints, ticks).
        name
            Name of the body in the MJCF.
        gravity
            Gravity, m/s², shape (3,). Default: the MJCF's.

        Returns
        -------
        array
            Forces per unit of each parameter in `INERTIAL`, N or Nm per kg, kg m or kg m², shape
            (10, joints, ticks). Rounding errors are set to exactly 0.
        """
        model = copy(self._model)
        number = model.body(name).id
        # MuJoCo warns of joints without inertia. The added inertia is in all columns and cancels.
        model.dof_armature[:] += HEAVIER
        model.body_sameframe[number] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        forces = []
        # Such a body is not physical, but inverse dynamics only multiplies and adds its parameters.
        for unit in np.eye(len(INERTIAL) + 1)[:, :-1]:
            mass, centre, principal, axes = _arrange_unit(unit)
            model.body_mass[number], model.body_ipos[number] = mass, centre
            model.body_inertia[number], model.body_iquat[number] = principal, axes
            forces.append(self._forces(model, motion, gravity))
        massless = forces.pop()
        columns = np.stack(forces) - massless
        # Column of a first moment = (1 kg at 1 m) − (1 kg at the origin).
        columns[1:4] -= columns[0]
        rounding = ROUNDING * max(float(np.max(np.abs(each))) for each in (columns, massless))
        columns[np.max(np.abs(columns), axis=2) < rounding] = 0.0
        return columns

    def forces(self, motion: Array, gravity: Array | None = None) -> Array:
        """Return the joints' forces that a motion requires.

        Parameters
        ----------
        motion
            Positions, velocities and accelerations, shape (3, joints, ticks).
        gravity
            Gravity, m/s², shape (3,). Default: the MJCF's.

        Returns
        -------
        array
            Forces, N or Nm, shape (joints, ticks).
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
            forces=data.qfrc_inverse,
            motion=np.ascontiguousarray(motion),
            out=out,
        )
        return out
