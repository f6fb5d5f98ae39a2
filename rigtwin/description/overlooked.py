"""What of an MJCF a machine's replays do not take into account: said, never silently dropped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from rigtwin.description.machine import Component, ReplayOf
from rigtwin.description.mechanism import Mechanism

ELEMENTS = (("free", mujoco.mjtJoint.mjJNT_FREE), ("ball", mujoco.mjtJoint.mjJNT_BALL))
"""Joints that no replay moves."""


def overlooked(
    mechanism: Mechanism, components: Mapping[str, Component], replays: Sequence[ReplayOf]
) -> tuple[str, ...]:
    """What of a model is not taken into account.

    Parameters
    ----------
    mechanism
        The MJCF.
    components
        Of the description.
    replays
        Of the description.

    Returns
    -------
    tuple
        A line each.
    """
    model = mechanism.model
    free = any(replay.free for replay in replays)
    ties = mechanism.ties() if free else ()
    return (
        *_joints(model, components, replays, {tie.joint for tie in ties}),
        *_dissipation(model, components),
        *_constraints(model, {tie.number for tie in ties}),
        *_actuators(model),
    )


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    return mujoco.mj_id2name(model, kind, number) or f"number {number}"


def _joints(
    model: mujoco.MjModel,
    components: Mapping[str, Component],
    replays: Sequence[ReplayOf],
    tied: set[str],
) -> Iterator[str]:
    moved = {components[name].joint for replay in replays for name in replay.moved_by}
    moved |= {joint for replay in replays for joint in replay.free}
    for number in range(model.njnt):
        name = _name(model, mujoco.mjtObj.mjOBJ_JOINT, number)
        for said, kind in ELEMENTS:
            if model.jnt_type[number] == kind:
                yield f"joint {name}: it is a {said} joint, and stays where it is"
                break
        else:
            if name not in moved | tied:
                yield f"joint {name}: no replay moves it, so it stays where it is"
            if model.jnt_limited[number]:
                yield f"joint {name}: the stops at the ends of its range"


def _dissipation(model: mujoco.MjModel, components: Mapping[str, Component]) -> Iterator[str]:
    """Dry friction that no component stands for: it is none of what MuJoCo's inverse dynamics
    give without constraints."""
    described = {(each.element, each.mjcf) for each in components.values() if each.channel is None}
    for number in range(model.njnt):
        name = _name(model, mujoco.mjtObj.mjOBJ_JOINT, number)
        lost = model.dof_frictionloss[model.jnt_dofadr[number]]
        if lost > 0.0 and ("joint", name) not in described:
            yield f"joint {name}: its frictionloss, as it is no component"
    for number in range(model.ntendon):
        name = _name(model, mujoco.mjtObj.mjOBJ_TENDON, number)
        if ("tendon", name) not in described:
            yield f"tendon {name}: it is no component"


def _constraints(model: mujoco.MjModel, kept: set[int]) -> Iterator[str]:
    """kept: equalities that are taken into account."""
    touching = np.count_nonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    if touching > 1 or model.npair:
        yield "contacts between its geoms"
    for number in sorted(set(range(model.neq)) - kept):
        yield f"equality {_name(model, mujoco.mjtObj.mjOBJ_EQUALITY, number)}"
    if model.nflex:
        yield "flexible bodies"
    if model.nplugin:
        yield "plugins"


def _actuators(model: mujoco.MjModel) -> Iterator[str]:
    for number in range(model.nu):
        name = _name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, number)
        if model.actuator_gaintype[number] == mujoco.mjtGain.mjGAIN_MUSCLE:
            yield f"actuator {name}: it is a muscle"
        elif model.actuator_dyntype[number] != mujoco.mjtDyn.mjDYN_NONE:
            yield f"actuator {name}: its activation dynamics"
        bias = model.actuator_biasprm[number]
        if model.actuator_biastype[number] != mujoco.mjtBias.mjBIAS_NONE and not bias[1]:
            if bias[0]:
                yield f"actuator {name}: its constant force {bias[0]:g}"
            if bias[2]:
                yield f"actuator {name}: its force by velocity, {bias[2]:g}"
        low, high = model.actuator_forcerange[number]
        if model.actuator_forcelimited[number] and not np.isclose(low, -high):
            yield f"actuator {name}: its forcerange's lower end {low:g}; taken as {-high:g}"
