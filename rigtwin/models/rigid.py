"""The forces that a mechanism's bodies take to move as prescribed, by MuJoCo's inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

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
        numbers = [model.joint(name).id for name in joints]
        self._places = np.array([model.jnt_qposadr[number] for number in numbers], np.int64)
        self._dofs = np.array([model.jnt_dofadr[number] for number in numbers], np.int64)

    def forces(self, motion: Array) -> Array:
        """The forces on the joints.

        Parameters
        ----------
        motion
            Positions, velocities and accelerations, shape (3, joints, ticks).

        Returns
        -------
        array
            N or Nm, shape (joints, ticks).
        """
        data = mujoco.MjData(self._model)
        out = np.empty(motion.shape[1:])
        _invert(
            model=self._model._address,
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
