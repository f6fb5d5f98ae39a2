"""Coupling of a mechanism's joints by inertia or gravity."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from rigtwin.description.mechanism import Mechanism

POSES, SHARE = 7, 1e-6
"""Number of poses, and the share of the diagonal terms below which a coupling term is zero."""


def are_coupled(mechanism: Mechanism, joints: Sequence[str]) -> bool:
    """Return whether any two of the joints act on each other.

    The mass matrix M(q) is evaluated at several poses within the ranges of the joints. Joints i and
    j act on each other where M_ij is not zero, or where M_ii or the gravity load of i depends on
    the position of j, as the inertia about a vertical axis does on the angle of what it carries.
    Tendons and equalities that span two of the joints couple them too.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joints
        Names of hinges and slides.
    """
    model = mechanism.model
    if len(joints) < 2:
        return False
    # Any tendon counts, as its friction or stiffness acts on all joints that it passes.
    if model.ntendon or any(tie.joint in joints and tie.to in joints for tie in mechanism.ties()):
        return True
    # A coupling term can vanish at one pose by symmetry (a stretched arm), hence several random
    # ones. The seed is fixed, so that a description always gives the same structure.
    numbers = [mechanism.number("joint", joint) for joint in joints]
    at = [int(model.jnt_dofadr[number]) for number in numbers]
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    full = np.zeros((model.nv, model.nv))
    weights = _weights(mechanism, at)
    for _ in range(POSES):
        _pose(model, data, numbers, random)
        mujoco.mj_fullM(model, data, full)
        # |M_ij| ≤ √(M_ii·M_jj) in a positive definite matrix, so the ratio lies between 0 and 1.
        scale = np.sqrt(np.outer(np.diag(full)[at], np.diag(full)[at]))
        off = np.abs(full[np.ix_(at, at)]) / np.maximum(scale, 1e-300)
        np.fill_diagonal(off, 0.0)
        if off.max() > SHARE or _acts_on_others(model, data, numbers, at, weights):
            return True
    return False


def _pose(
    model: mujoco.MjModel, data: mujoco.MjData, numbers: Sequence[int], random: np.random.Generator
) -> None:
    """Put the joints at random positions, at rest, so that qfrc_bias is the gravity load alone."""
    for number in numbers:
        # Without a range, 1 m or 1 rad to either side is tried.
        low, high = model.jnt_range[number] if model.jnt_limited[number] else (-1.0, 1.0)
        data.qpos[model.jnt_qposadr[number]] = random.uniform(low, high)
    data.qvel[:] = 0.0
    mujoco.mj_forward(model, data)


def _weights(mechanism: Mechanism, at: Sequence[int]) -> float:
    """Return a scale of the gravity load, N or Nm: the weight of all bodies at a lever of 1 m."""
    model = mechanism.model
    return float(np.sum(model.body_mass) * np.linalg.norm(model.opt.gravity)) * len(at)


def _acts_on_others(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    numbers: Sequence[int],
    at: Sequence[int],
    weights: float,
) -> bool:
    """Return whether inertia or gravity load of one joint changes with the position of another."""
    before, full = data.qfrc_bias[list(at)].copy(), np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    inertia = np.diag(full)[at]
    for index, number in enumerate(numbers):
        place = int(model.jnt_qposadr[number])
        original = float(data.qpos[place])
        # 0.1 rad or m: large against rounding, small against the period of a sine.
        data.qpos[place] = original + 0.1
        mujoco.mj_forward(model, data)
        change = np.abs(data.qfrc_bias[list(at)] - before)
        # A joint's gravity load may depend on its own position without any coupling.
        change[index] = 0.0
        mujoco.mj_fullM(model, data, full)
        growth = np.abs(np.diag(full)[at] / np.maximum(inertia, 1e-300) - 1.0)
        growth[index] = 0.0
        data.qpos[place] = original
        if change.max() > SHARE * max(weights, 1e-300) or growth.max() > SHARE:
            return True
    mujoco.mj_forward(model, data)
    return False
