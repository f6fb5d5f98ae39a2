"""What of an MJCF a machine's replays do not take into account: said, never silently dropped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from rigtwin.description.machine import Component, ReplayOf
from rigtwin.description.mechanism import Mechanism, Tie

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
    ties = _followed_ties(mechanism, components, replays)
    return (
        *_joints(model, components, replays, {tie.joint for tie in ties}),
        *_dissipation(model, components),
        *_constraints(model, {tie.number for tie in ties}),
        *_actuators(model, components),
    )


def _followed_ties(
    mechanism: Mechanism, components: Mapping[str, Component], replays: Sequence[ReplayOf]
) -> tuple[Tie, ...]:
    """Equalities that a replay with free joints takes into account."""
    free = [joint for replay in replays for joint in replay.free]
    if not free:
        return ()
    movers = [components[name] for replay in replays for name in replay.moved_by]
    held = [each.joint for each in movers if each.element != "actuator"]
    led = {tie.joint for tie in mechanism.ties_of([*free, *held])[0]}
    acted = [each.joint for each in movers if each.joint and each.joint not in led]
    return mechanism.ties_of([*free, *held, *acted])[0]


def _moving(components: Mapping[str, Component], replays: Sequence[ReplayOf]) -> set[str]:
    """Joints that the replays move."""
    moving = {joint for replay in replays for joint in replay.free}
    return moving | {components[name].joint for replay in replays for name in replay.moved_by}


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    return mujoco.mj_id2name(model, kind, number) or f"number {number}"


def _joints(
    model: mujoco.MjModel,
    components: Mapping[str, Component],
    replays: Sequence[ReplayOf],
    tied: set[str],
) -> Iterator[str]:
    moved = _moving(components, replays)
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


def _actuators(model: mujoco.MjModel, components: Mapping[str, Component]) -> Iterator[str]:
    """Force laws of actuators that are no component, and forces that are limited on one side more
    than on the other."""
    described = {each.mjcf for each in components.values() if each.element == "actuator"}
    for number in range(model.nactuator):
        name = _name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, number)
        bias = model.actuator_biasprm[number]
        pushes = model.actuator_biastype[number] != mujoco.mjtBias.mjBIAS_NONE and bias[:3].any()
        if name not in described and pushes:
            yield f"actuator {name}: it is no component, so the force that it has without a command"
        low, high = model.actuator_forcerange[number]
        if model.actuator_forcelimited[number] and not np.isclose(low, -high):
            yield f"actuator {name}: its forcerange's lower end {low:g}; taken as {-high:g}"
