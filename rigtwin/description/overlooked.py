"""Features of an MJCF that a machine's replays ignore. They are listed for the user instead of
being dropped silently."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from rigtwin.components import Guide
from rigtwin.components.sensors import MEASURES
from rigtwin.description.component import Component
from rigtwin.description.mechanism import Mechanism, Tie
from rigtwin.description.replay import ReplayOf

ELEMENTS = (("free", mujoco.mjtJoint.mjJNT_FREE), ("ball", mujoco.mjtJoint.mjJNT_BALL))
"""Types of joints that no replay moves, with their MJCF names."""
FLAGS = (
    (mujoco.mjtDisableBit.mjDSBL_SPRING, "spring"),
    (mujoco.mjtDisableBit.mjDSBL_DAMPER, "damper"),
    (mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS, "frictionloss"),
    (mujoco.mjtDisableBit.mjDSBL_ACTUATION, "actuation"),
    (mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL, "clampctrl"),
)
"""Flags of the option element that change forces, with their MJCF names."""


def overlooked(
    mechanism: Mechanism, components: Mapping[str, Component], replays: Sequence[ReplayOf]
) -> tuple[str, ...]:
    """Return the features of a model that the replays ignore.

    Parameters
    ----------
    mechanism
        Compiled MJCF.
    components
        Described components by name.
    replays
        Described replays.

    Returns
    -------
    tuple of str
        One line per feature.
    """
    model = mechanism.model
    ties = _followed_ties(mechanism, components, replays)
    moved = _moving(components, replays) | {tie.joint for tie in ties}
    return (
        *_joints(model, moved),
        *_dissipation(model, components),
        *_limits(model, moved),
        *_options(model, moved),
        *_polynomials(mechanism, components),
        *_constraints(model, {tie.number for tie in ties}),
        *_actuators(model, components),
    )


def _followed_ties(
    mechanism: Mechanism, components: Mapping[str, Component], replays: Sequence[ReplayOf]
) -> tuple[Tie, ...]:
    """Return the joint equalities that replays with free joints satisfy."""
    free = [joint for replay in replays for joint in replay.free]
    if not free:
        # A joint that is replayed alone carries along what is tied to it.
        alone = [replay.joint.name for replay in replays if replay.guide or replay.mass]
        return tuple(tie for joint in alone for tie in mechanism.ties_of([joint])[0])
    movers = [components[name] for replay in replays for name in replay.moved_by]
    prescribed = [mover.joint for mover in movers if mover.component_type in MEASURES]
    dependent = {tie.joint for tie in mechanism.ties_of([*free, *prescribed])[0]}
    # An actuator on a dependent joint pushes the joint that is followed, and adds no moving joint.
    pushed = [mover.joint for mover in movers if mover.joint and mover.joint not in dependent]
    return mechanism.ties_of([*free, *prescribed, *pushed])[0]


def _moving(components: Mapping[str, Component], replays: Sequence[ReplayOf]) -> set[str]:
    """Return the joints that the replays move."""
    moving = {joint for replay in replays for joint in replay.free}
    return moving | {components[name].joint for replay in replays for name in replay.moved_by}


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    """Return the name of an element, or its index if it has no name."""
    return mujoco.mj_id2name(model, kind, number) or f"number {number}"


def _joints(model: mujoco.MjModel, moved: set[str]) -> Iterator[str]:
    """Yield the joints that no replay moves, and the stops of joints with a range."""
    for number in range(model.njnt):
        name = _name(model, mujoco.mjtObj.mjOBJ_JOINT, number)
        for word, kind in ELEMENTS:
            if model.jnt_type[number] == kind:
                yield f"joint {name}: it is a {word} joint, so it stays where it is"
                break
        else:
            if name not in moved:
                yield f"joint {name}: no replay moves it, so it stays where it is"
            if model.jnt_limited[number]:
                # Contacts with the stops are constraints, which all models leave out.
                yield f"joint {name}: the stops at the ends of its range"


def _dissipation(model: mujoco.MjModel, components: Mapping[str, Component]) -> Iterator[str]:
    """Yield joints with dry friction, and tendons, that no component describes.

    MuJoCo treats dry friction as a constraint, and the models' inverse dynamics leaves constraints
    out. Components model the friction instead.
    """
    # Sensors and actuators have channels; the remaining components are guides, rotors and masses.
    described = {(part.element, part.mjcf) for part in components.values() if part.channel is None}
    for number in range(model.njnt):
        name = _name(model, mujoco.mjtObj.mjOBJ_JOINT, number)
        friction = model.dof_frictionloss[model.jnt_dofadr[number]]
        if friction > 0.0 and ("joint", name) not in described:
            yield f"joint {name}: its frictionloss; no component describes the joint"
    for number in range(model.ntendon):
        name = _name(model, mujoco.mjtObj.mjOBJ_TENDON, number)
        if ("tendon", name) not in described:
            yield f"tendon {name}: no component describes it"


def _limits(model: mujoco.MjModel, moved: set[str]) -> Iterator[str]:
    """Yield limits of tendons, and those of the actuators' forces that no actuator can have."""
    for number in map(int, np.flatnonzero(model.tendon_limited)):
        yield f"tendon {_name(model, mujoco.mjtObj.mjOBJ_TENDON, number)}: the limits of its length"
    pushed = model.actuator_trnid[model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, 0]
    for number in map(int, np.flatnonzero(model.jnt_actfrclimited)):
        name, (low, high) = (
            _name(model, mujoco.mjtObj.mjOBJ_JOINT, number),
            model.jnt_actfrcrange[number],
        )
        # The limit of a single actuator with the same limit in both directions is its own.
        own = np.count_nonzero(pushed == number) == 1 and np.isclose(low, -high)
        if name in moved and not own:
            yield f"joint {name}: its actuatorfrcrange"


def _options(model: mujoco.MjModel, moved: set[str]) -> Iterator[str]:
    """Yield options of the model that change forces, which the components do not follow."""
    for flag, word in FLAGS:
        if model.opt.disableflags & flag:
            yield f'option flag {word}="disable"'
    if model.opt.disableactuator:
        yield "option actuatorgroupdisable"
    # Several joints have MuJoCo's own passive forces; the load of a single one is that of gravity.
    if len(moved) == 1 and (model.opt.density or model.opt.viscosity):
        yield "forces of the medium: density, viscosity and wind of the option"


def _polynomials(mechanism: Mechanism, components: Mapping[str, Component]) -> Iterator[str]:
    """Yield what springs and dampers of the model have beyond a guide's law."""
    for part in components.values():
        if part.component_type is Guide and part.element in ("joint", "tendon"):
            for feature in mechanism.beyond_guide(part.element, part.mjcf):
                yield f"{part.element} {part.mjcf}: the {feature}"


def _constraints(model: mujoco.MjModel, followed: set[int]) -> Iterator[str]:
    """Yield contacts, equalities and plugins. followed: indices of equalities that replays obey."""
    # A contact takes two geoms whose contype and conaffinity allow it.
    touching = np.count_nonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    if touching > 1 or model.npair:
        yield "contacts between its geoms"
    for number in sorted(set(map(int, np.flatnonzero(model.eq_active0))) - followed):
        yield f"equality {_name(model, mujoco.mjtObj.mjOBJ_EQUALITY, number)}"
    if model.nflex:
        yield "flexible bodies"
    if model.nplugin:
        yield "plugins"


def _actuators(model: mujoco.MjModel, components: Mapping[str, Component]) -> Iterator[str]:
    """Yield actuators that no component describes but that act, and asymmetric force limits."""
    described = {part.mjcf for part in components.values() if part.element == "actuator"}
    for number in range(model.nactuator):
        name = _name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, number)
        bias = model.actuator_biasprm[number]
        pushes = model.actuator_biastype[number] != mujoco.mjtBias.mjBIAS_NONE and bias[:3].any()
        if name not in described and pushes:
            yield f"actuator {name}: its force without a command; no component describes it"
        elif name not in described and described:
            # Where commands move the machine, those of any other actuator would move it too.
            yield f"actuator {name}: its command; no component describes it"
        low, high = model.actuator_forcerange[number]
        # A component has one force limit for both directions: the upper end of the range.
        if model.actuator_forcelimited[number] and not np.isclose(low, -high):
            yield f"actuator {name}: lower end {low:g} of its forcerange; taken as {-high:g}"
