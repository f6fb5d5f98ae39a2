"""Components and replays that follow from the joints of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigtwin.description.joint_elements import (
    body_of,
    identifier,
    sensor_on,
)
from rigtwin.description.mechanism import Mechanism

FREE = [
    "coulomb",
    "viscous",
    "drag",
    "offset",
    "stiffness",
    "cubic_stiffness",
    "stribeck",
    "load_friction",
    "position_force",
    "end_stops",
]
"""Effects at coupled joints that are free to move."""
UP = 0.5
"""Share of the largest component of gravity from which an axis counts as vertical."""
ALONG = 0.9
"""Component of a joint's axis from which the axis counts as one of its body's own."""
FREE_SERVO = [
    "gains",
    "position_gain",
    "damping_gain",
    "delay",
    "lag",
    "force_limit",
    "rate_limit",
    "deadband",
    "backlash",
]
"""Effects of servos that move coupled joints."""


@dataclass
class Implied:
    """Tables that a description implies.

    Attributes
    ----------
    components
        Component name → table.
    replays
        Tables of the replays.
    """

    components: dict[str, dict[str, Any]] = field(default_factory=dict)
    replays: list[Mapping[str, Any]] = field(default_factory=list)


def add_free_joints(
    joints: Sequence[str],
    mechanism: Mechanism,
    tables: dict[str, dict[str, Any]],
    free: Sequence[str],
) -> None:
    """Add the effects and links of coupled joints whose motion follows from forces."""
    for joint in joints:
        tables[identifier(joint)]["effects"] = FREE
    # Without a known force, only ratios of friction and masses to one of the masses can be seen.
    # One force of an actuator or a spring is enough, since coupled joints pass it on.
    unknown = free and not _has_spring(mechanism, joints)
    held = ["mass", "payload", *_levers(mechanism, joints[-1])]
    add_links(mechanism, joints[1:] if unknown else joints, held, tables)


def _levers(mechanism: Mechanism, joint: str) -> list[str]:
    """Return the effects of a wrong centre of mass of the body that a joint moves.

    A displacement along the joint's own axis changes no force of this joint, and a slide carries
    its body whatever the place of the centre.
    """
    if not mechanism.turns(joint):
        return []
    axis = np.abs(mechanism.model.jnt_axis[mechanism.number("joint", joint)])
    return [f"lever_{name}" for name, share in zip("xyz", axis, strict=True) if share < ALONG]


def _has_spring(mechanism: Mechanism, joints: Sequence[str]) -> bool:
    """Return whether the model states the stiffness of a spring at these joints or between them."""
    springs = [("joint", joint) for joint in joints]
    springs += [("tendon", tendon) for tendon in _tendons_of(mechanism, joints)]
    return any(mechanism.friction(*spring)["stiffness"] for spring in springs)


def sensor_table(mechanism: Mechanism, joint: str, measured: str) -> dict[str, Any]:
    """Return the table of a sensor: one of the MJCF, or one without an element of its own."""
    known = sensor_on(mechanism, joint, measured)
    return {"sensor": known} if known else {"joint": joint, "type": f"{measured} sensor"}


def add_base(mechanism: Mechanism, tables: dict[str, dict[str, Any]]) -> None:
    """Add the base of coupled joints under gravity, which may be off level."""
    gravity = np.abs(mechanism.model.opt.gravity)
    known = any(table.get("type") == "base" for table in tables.values())
    if known or not gravity.any():
        return
    # A turn about the direction of gravity has no effect.
    level = [axis for axis, share in zip("xyz", gravity / gravity.max(), strict=True) if share < UP]
    tables["base_level" if "base" in tables else "base"] = {
        "body": "world",
        "type": "base",
        "effects": [f"tilt_{axis}" for axis in level],
    }


def add_tendons(
    mechanism: Mechanism, joints: Sequence[str], tables: dict[str, dict[str, Any]]
) -> None:
    """Add the fixed tendons that couple joints: by friction, as in a wrist, or by a spring."""
    for tendon in _tendons_of(mechanism, joints):
        effects = ["coulomb", "viscous"]
        if mechanism.friction("tendon", tendon)["stiffness"]:
            effects += ["stiffness", "cubic_stiffness", "slack"]
        tables[identifier(tendon)] = {"tendon": tendon, "effects": effects}


def _tendons_of(mechanism: Mechanism, joints: Sequence[str]) -> list[str]:
    """Return the fixed tendons that couple these joints and no other joint.

    A tendon that passes another joint too would see a motion that is not measured.
    """
    passed = {
        tendon: {joint for joint, _ in mechanism.acts_on("tendon", tendon)}
        for tendon in mechanism.names("tendon")
    }
    return [tendon for tendon, along in passed.items() if along and along <= set(joints)]


def add_rotor(joint: str, tables: dict[str, dict[str, Any]]) -> None:
    """Add the rotor that turns with a joint: data sheets of robots seldom state its inertia."""
    name = f"{identifier(joint)}_rotor"
    # A joint or a body of the model may have that name already.
    name = f"{name}_inertia" if name in tables else name
    tables[name] = {"joint": joint, "type": "rotor", "effects": ["armature"]}


def add_links(
    mechanism: Mechanism,
    joints: Sequence[str],
    last: Sequence[str],
    tables: dict[str, dict[str, Any]],
) -> None:
    """Add the rigid bodies that joints carry: their masses, and the effects of the last one."""
    for joint in joints:
        _add_link(mechanism, joint, last if joint == joints[-1] else ["mass"], tables)


def _add_link(
    mechanism: Mechanism, joint: str, effects: Sequence[str], tables: dict[str, dict[str, Any]]
) -> None:
    """Add the rigid body that a joint moves, if it has a name."""
    body = body_of(mechanism, joint)
    if body:
        name = identifier(body)
        name = f"{name}_body" if name in tables else name
        tables[name] = {"body": body, "type": "body", "effects": list(effects)}


def add_mass(mechanism: Mechanism, joint: str, tables: dict[str, dict[str, Any]]) -> None:
    """Add the mass that moves with a joint that is replayed alone."""
    body = body_of(mechanism, joint)
    # A body with several joints moves with more than this one.
    if body and mechanism.joint_of("body", body) == joint:
        name = identifier(body)
        tables[f"{name}_mass" if name in tables else name] = {"body": body, "effects": ["mass"]}
