"""Components and replays that a description does not write down: those that follow from the model
and from the kind of the test."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco

from rigtwin.description.coupling import act_on_each_other
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, near

INVERSE, POSITIONS, SERVOS, FORCES = (
    "inverse dynamics",
    "position commands",
    "servos",
    "force commands",
)
TESTS = {
    INVERSE: "the joints move as measured, and the forces that this takes are predicted",
    POSITIONS: "each joint follows its command, nominally at once, and its position is predicted",
    SERVOS: "MuJoCo's position actuators push the joints, and their positions are predicted",
    FORCES: "commanded forces push the joints, and their positions are predicted",
}
"""Kind of test → what is predicted from what."""
MOVERS = {POSITIONS: "position actuator", SERVOS: "servo", FORCES: "force actuator"}
"""Kind of test → type of the components that take its commands."""
KEYS = ("test", "joints")
"""Keys of a replay whose components are implied."""
RUBBING = ["coulomb", "viscous", "offset", "asymmetry", "stribeck", "load_friction", "drag"]
"""Effects at joints that act on each other and all move as measured."""
FREE = {
    FORCES: ["coulomb", "viscous", "offset", "stiffness"],
    SERVOS: ["coulomb", "viscous", "offset"],
}
"""Effects at joints that act on each other and are free to move: every one costs integrations."""
FREE_SERVO = ["position_gain", "damping_gain", "delay", "lag"]
"""Effects of servos that move such joints."""


@dataclass
class Implied:
    """Tables as they are implied. components: name → table; replays: their tables."""

    components: dict[str, dict[str, Any]] = field(default_factory=dict)
    replays: list[Mapping[str, Any]] = field(default_factory=list)


def expand(
    document: Mapping[str, Any], mechanism: Mechanism, mistakes: Mistakes
) -> Mapping[str, Any]:
    """Return a description with all components and replays written down.

    A replay with the key `test` names its joints instead of its components. A component that is
    implied can be given a table of its own name, which states only what differs.

    Parameters
    ----------
    document
        The description as its TOML has it.
    mechanism
        The compiled MJCF or URDF.
    mistakes
        List that mistakes in `test` and `joints` are added to.
    """
    replays = document.get("replays", [])
    if not isinstance(replays, list) or not any(
        isinstance(table, Mapping) and "test" in table for table in replays
    ):
        return document
    written = document.get("components", {})
    written = written if isinstance(written, Mapping) else {}
    implied = Implied()
    for table in replays:
        if isinstance(table, Mapping) and "test" in table:
            _expand_replay(table, mechanism, implied, mistakes)
        else:
            implied.replays.append(table)
    components: dict[str, Any] = {}
    for name, table in implied.components.items():
        own = written.get(name, {})
        components[name] = {**table, **own} if isinstance(own, Mapping) else own
    components |= {name: table for name, table in written.items() if name not in components}
    return {**document, "components": components, "replays": implied.replays}


def movable_joints(mechanism: Mechanism) -> list[str]:
    """Names of the hinges and slides of a model, in its order."""
    model = mechanism.model
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    numbers = [n for n in range(model.njnt) if int(model.jnt_type[n]) in single]
    return [name for n in numbers if (name := mechanism.joint_name(n))]


def actuator_on(mechanism: Mechanism, joint: str) -> str | None:
    """Name of the actuator that acts on a joint alone; None if no actuator has a name and does."""
    for name in mechanism.names("actuator"):
        if mechanism.joint_of("actuator", name) == joint:
            return name
    return None


def sensor_on(mechanism: Mechanism, joint: str, measured: str) -> str | None:
    """Name of the sensor of a joint's position, velocity or force; None without one."""
    for name in mechanism.names("sensor"):
        if mechanism.joint_of("sensor", name) == joint and mechanism.measures(name) == measured:
            return name
    return None


def sensor_name(mechanism: Mechanism, joint: str, measured: str) -> str:
    """Name of the implied component that measures a joint's position, velocity or force."""
    known = sensor_on(mechanism, joint, measured)
    name = identifier(known) if known else f"{identifier(joint)}_{measured}"
    return f"{name}_{measured}" if name == identifier(joint) else name


def actuator_name(mechanism: Mechanism, joint: str) -> str | None:
    """Name of the implied component that moves a joint; None if the model has no such actuator."""
    known = actuator_on(mechanism, joint)
    if known is None:
        return None
    name = identifier(known)
    taken = {identifier(joint) for joint in movable_joints(mechanism)}
    taken |= {identifier(each) for each in mechanism.names("sensor")}
    return f"{name}_actuator" if name in taken else name


def identifier(name: str) -> str:
    """A name of the model as a component can have it: letters, digits and _."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return plain if re.match(r"[A-Za-z]", plain) else f"n{plain}"


def _expand_replay(
    table: Mapping[str, Any], mechanism: Mechanism, implied: Implied, mistakes: Mistakes
) -> None:
    where = f"[[replays]] {table.get('name', len(implied.replays) + 1)}"
    test, known = table["test"], movable_joints(mechanism)
    if test not in TESTS:
        mistakes.note(where, f"test = {str(test)[:40]!r}; {near(test, TESTS)}")
        return
    joints = table.get("joints", known)
    if not isinstance(joints, list) or not joints:
        mistakes.note(where, f"joints = {str(joints)[:40]}: expected a list of joints")
        return
    unknown = [joint for joint in joints if joint not in known]
    if unknown:
        mistakes.note(
            where, f"joints: {unknown[0]!r} is no hinge or slide; {near(unknown[0], known)}"
        )
        return
    for key in ("moved_by", "observe", "free"):
        if key in table:
            mistakes.note(where, f"{key} follows from test = {test!r}; leave one of them out")
            return
    missing = [j for j in joints if actuator_on(mechanism, j) is None]
    if test in (POSITIONS, SERVOS) and missing:
        mistakes.note(where, f"test = {test!r}: joint {missing[0]} has no position actuator")
        return
    if test == FORCES and len(missing) == len(joints):
        mistakes.note(where, f"test = {test!r}: no actuator acts on {', '.join(joints)}")
        return
    rest = {key: value for key, value in table.items() if key not in KEYS}
    together = test != POSITIONS and act_on_each_other(mechanism, joints)
    groups = [list(joints)] if together else [[joint] for joint in joints]
    for group in groups:
        own = rest if len(groups) == 1 else {**rest, "name": identifier(group[0])}
        own.setdefault("name", "all joints" if together else identifier(group[0]))
        _add_group(test, group, own, mechanism, implied)


def _add_group(
    test: str, joints: Sequence[str], rest: dict[str, Any], mechanism: Mechanism, implied: Implied
) -> None:
    """Add the components of joints that are replayed together, and their replay."""
    add = implied.components
    positions = [sensor_name(mechanism, joint, "position") for joint in joints]
    for joint, name in zip(joints, positions, strict=True):
        add[name] = _sensor(mechanism, joint, "position") | {"effects": []}
    if test != POSITIONS:
        for joint in joints:
            add[identifier(joint)] = {"joint": joint}
    if test == INVERSE:
        forces = [sensor_name(mechanism, joint, "force") for joint in joints]
        for joint, name in zip(joints, forces, strict=True):
            add[name] = _sensor(mechanism, joint, "force")
        if len(joints) > 1:
            for joint, name in zip(joints, forces, strict=True):
                add[identifier(joint)]["effects"] = RUBBING
                add[name]["effects"] = ["gain"]
            _add_tendons(mechanism, joints, add)
        else:
            _add_mass(mechanism, joints[0], add)
        implied.replays.append({**rest, "moved_by": positions, "observe": forces})
        return
    movers: list[str] = []
    for joint in joints:
        actuator, name = actuator_on(mechanism, joint), actuator_name(mechanism, joint)
        if actuator is None or name is None:
            continue
        add[name] = {"actuator": actuator}
        add[name]["type"] = MOVERS[test]
        movers.append(name)
    replay = {**rest, "moved_by": movers, "observe": positions}
    if test in (SERVOS, FORCES) and len(joints) == 1:
        _add_mass(mechanism, joints[0], add)
        if test == FORCES and any(mechanism.joint(joints[0]).gravity):
            add[positions[0]]["effects"] = ["offset"]  # Gravity shows the zero of the encoder.
    elif test in (SERVOS, FORCES):
        replay["free"] = list(joints)
        for joint in joints:
            add[identifier(joint)]["effects"] = FREE[test]
        for name in movers if test == SERVOS else ():
            add[name]["effects"] = FREE_SERVO
    implied.replays.append(replay)


def _sensor(mechanism: Mechanism, joint: str, measured: str) -> dict[str, Any]:
    known = sensor_on(mechanism, joint, measured)
    return {"sensor": known} if known else {"joint": joint, "type": f"{measured} sensor"}


def _add_tendons(
    mechanism: Mechanism, joints: Sequence[str], add: dict[str, dict[str, Any]]
) -> None:
    """Add the fixed tendons along which joints rub together, such as those of a coupled wrist."""
    for tendon in mechanism.names("tendon"):
        along = [joint for joint, _ in mechanism.acts_on("tendon", tendon)]
        if along and set(along) <= set(joints):
            add[identifier(tendon)] = {"tendon": tendon, "effects": ["coulomb", "viscous"]}


def _add_mass(mechanism: Mechanism, joint: str, add: dict[str, dict[str, Any]]) -> None:
    """Add the component of what moves with a joint that is replayed alone."""
    model = mechanism.model
    number = int(model.jnt_bodyid[mechanism.number("joint", joint)])
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, number)
    if body and mechanism.joint_of("body", body) == joint:
        name = identifier(body)
        add[f"{name}_mass" if name in add else name] = {"body": body, "effects": ["mass"]}
