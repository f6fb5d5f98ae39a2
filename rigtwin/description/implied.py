"""Implied components and replays: those that follow from the model and the kind of test, so that a
description need not write them down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rigtwin.description.actuator_law import VELOCITY_SERVO
from rigtwin.description.coupling import are_coupled
from rigtwin.description.implied_parts import (
    FREE_SERVO,
    Implied,
    add_base,
    add_free_joints,
    add_links,
    add_mass,
    add_rotor,
    add_tendons,
    sensor_table,
)
from rigtwin.description.joint_elements import (
    actuator_name,
    actuator_on,
    identifier,
    movable_joints,
    sensor_name,
    swinging,
)
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, suggest

INVERSE = "inverse dynamics"
POSITIONS = "position commands"
SERVOS = "servos"
FORCES = "force commands"
TESTS = {
    INVERSE: "the joints move as measured, and the forces that this takes are predicted",
    POSITIONS: "each joint follows its command, nominally at once, and its position is predicted",
    SERVOS: "MuJoCo's position actuators push the joints, and their positions are predicted",
    FORCES: "commanded forces, velocities or voltages drive the joints, and their positions are "
    "predicted",
}
"""Kind of test → its inputs and its predicted signals."""
MOVERS = {POSITIONS: "position actuator", SERVOS: "servo", FORCES: "force actuator"}
"""Kind of test → type of the components that take its commands."""
KEYS = ("test", "joints", "velocities", "resting")
"""Keys of a replay whose components are implied."""
PRESCRIBED = [
    "coulomb",
    "viscous",
    "offset",
    "stiffness",
    "cubic_stiffness",
    "asymmetry",
    "stribeck",
    "load_friction",
    "drag",
    "cogging",
    "position_force",
    "end_stops",
]
"""Effects at coupled joints with prescribed motion."""
PRESCRIBED_FORCE = ["gain", "lag", "delay"]
"""Effects of the measured forces at coupled joints with prescribed motion."""


def expand(
    document: Mapping[str, Any], mechanism: Mechanism, mistakes: Mistakes
) -> Mapping[str, Any]:
    """Return a description with all components and replays written down.

    A replay with the key `test` names its joints instead of its components. The description may
    have a table for an implied component, with only the keys that differ.

    Parameters
    ----------
    document
        Parsed description.
    mechanism
        Compiled MJCF or URDF.
    mistakes
        List to which mistakes in `test` and `joints` are added.
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
    # A key of the description replaces the implied one. A value that is not a table stays, so that
    # the reader of the components notes it.
    components: dict[str, Any] = {}
    # A machine has one base: one of another name in the description takes the implied one's place.
    bases = {n for n, t in written.items() if isinstance(t, Mapping) and t.get("type") == "base"}
    for name, table in implied.components.items():
        if table.get("type") == "base" and bases and name not in bases:
            continue
        changes = written.get(name, {})
        components[name] = {**table, **changes} if isinstance(changes, Mapping) else changes
    # Components that no test implies, such as a base, are added as they are.
    components |= {name: table for name, table in written.items() if name not in components}
    return {**document, "components": components, "replays": implied.replays}


def _expand_replay(
    table: Mapping[str, Any], mechanism: Mechanism, implied: Implied, mistakes: Mistakes
) -> None:
    """Add the components and replays that a replay with the key `test` implies; note mistakes."""
    where = f"[[replays]] {table.get('name', len(implied.replays) + 1)}"
    test, known = table["test"], movable_joints(mechanism)
    if not isinstance(test, str) or test not in TESTS:
        mistakes.note(where, f"test = {str(test)[:40]!r}; {suggest(test, TESTS)}")
        return
    joints = table.get("joints", known)
    if not isinstance(joints, list) or not joints:
        mistakes.note(where, f"joints = {str(joints)[:40]}: expected a list of joints")
        return
    unknown = [joint for joint in joints if joint not in known]
    if unknown:
        mistakes.note(
            where, f"joints: {unknown[0]!r} is no hinge or slide; {suggest(unknown[0], known)}"
        )
        return
    for key in ("moved_by", "observe", "free"):
        if key in table:
            mistakes.note(where, f"{key} follows from test = {test!r}; leave one of them out")
            return
    missing = [j for j in joints if actuator_on(mechanism, j) is None]
    # What a servo shakes may carry joints of its own, such as a seat on its spring.
    carried = test == SERVOS and len(missing) < len(joints) and are_coupled(mechanism, joints)
    if test in (POSITIONS, SERVOS) and missing and not carried:
        mistakes.note(where, f"test = {test!r}: joint {missing[0]} has no position actuator")
        return
    velocities = table.get("velocities", [])
    if velocities and test != FORCES:
        mistakes.note(where, f"velocities: with test = {test!r} positions are measured")
        return
    if not isinstance(velocities, list) or not set(map(str, velocities)) <= set(joints):
        mistakes.note(where, f"velocities = {str(velocities)[:40]}: expected a list of joints")
        return
    resting = table.get("resting", [])
    if not isinstance(resting, list) or not set(map(str, resting)) < set(joints):
        expected = f"expected a list of some of {', '.join(joints)}, not all"
        mistakes.note(where, f"resting = {str(resting)[:40]}: {expected}")
        return
    if resting and test != INVERSE:
        mistakes.note(where, f"resting: with test = {test!r} no forces are predicted")
        return
    keys = {key: value for key, value in table.items() if key not in KEYS}
    # Joints under position commands follow them whatever the load: coupling has no influence.
    together = test != POSITIONS and are_coupled(mechanism, joints)
    groups = [list(joints)] if together else [[j] for j in joints if j not in resting]
    for group in groups:
        # One table becomes several replays, which need names of their own.
        group_keys = keys if len(groups) == 1 else {**keys, "name": identifier(group[0])}
        group_keys.setdefault("name", "all joints" if together else identifier(group[0]))
        free = swinging(mechanism, joints)
        _add_group(test, group, group_keys, mechanism, implied, free, velocities, resting)
    if together:
        # The base comes last: a joint may have its name.
        add_base(mechanism, implied.components)


def _add_group(
    test: str,
    joints: Sequence[str],
    keys: dict[str, Any],
    mechanism: Mechanism,
    implied: Implied,
    free: Sequence[str],
    velocities: Sequence[str],
    resting: Sequence[str],
) -> None:
    """Add the components of joints that are replayed together, and their replay.

    `free` are the joints that swing freely, `velocities` those whose velocity is measured in place
    of their position, and `resting` those whose force is not judged.
    """
    tables = implied.components
    sensors: list[str] = []
    for joint in joints:
        measured = "velocity" if joint in velocities else "position"
        name = sensor_name(mechanism, joint, measured)
        sensors.append(name)
        # The measured motions are the reference of the test: errors of their sensors would be
        # confounded with effects of the joints.
        tables[name] = sensor_table(mechanism, joint, measured) | {"effects": []}
    if test != POSITIONS:
        for joint in joints:
            # Position commands move the joint whatever the load, so its friction cannot be seen.
            tables[identifier(joint)] = {"joint": joint}
    if test == INVERSE:
        forces = _add_forces(joints, resting, mechanism, tables)
        for joint, name in zip(joints, sensors, strict=True) if len(joints) > 1 else ():
            # A wrong zero shows in the gravity loads, as a constant force of one joint does not.
            if joint not in resting and any(mechanism.joint(joint).gravity):
                tables[name]["effects"] = ["offset"]
        implied.replays.append({**keys, "moved_by": sensors, "observe": forces})
        return
    movers = _add_movers(test, joints, mechanism, tables, free)
    replay = {**keys, "moved_by": movers, "observe": sensors}
    if test != POSITIONS and len(joints) > 1:
        replay["free"] = list(joints)
        add_free_joints(joints, mechanism, tables, free)
        add_tendons(mechanism, joints, tables)
        for name in movers if test == SERVOS else ():
            tables[name]["effects"] = FREE_SERVO
        for joint, name in zip(joints, sensors, strict=True):
            tables[name]["effects"] = _sensor_effects(mechanism, joint, test, joint in velocities)
    elif test != POSITIONS:
        add_mass(mechanism, joints[0], tables)
        add_rotor(joints[0], tables)
        weighs = any(mechanism.joint(joints[0]).gravity) and joints[0] not in velocities
        if test == FORCES and weighs:
            # The gravity load depends on the true angle, which makes the encoder's zero observable.
            tables[sensors[0]]["effects"] = ["offset"]
        if test == FORCES and mechanism.turns(joints[0]) and joints[0] not in velocities:
            tables[sensors[0]]["effects"].append("eccentricity")
    implied.replays.append(replay)


def _sensor_effects(mechanism: Mechanism, joint: str, test: str, has_velocity: bool) -> list[str]:
    """Return the effects of a sensor of a joint that moves together with others."""
    effects: list[str] = []
    if test == SERVOS and any(mechanism.joint(joint).gravity):
        # The zero of a servo's encoder shows in the gravity loads alone.
        effects.append("offset")
    # The servo acts by the reading of its own encoder. A late sensor of a joint that no servo moves
    # lags behind the motion that the commands, or the other joints, cause.
    is_servo = test == SERVOS and actuator_on(mechanism, joint) is not None
    if not is_servo and not has_velocity:
        effects.append("delay")
    if test == FORCES and mechanism.turns(joint) and not has_velocity:
        effects.append("eccentricity")
    return effects


def _add_forces(
    joints: Sequence[str],
    resting: Sequence[str],
    mechanism: Mechanism,
    tables: dict[str, dict[str, Any]],
) -> list[str]:
    """Add the components of joints that move as measured; return the names of the force sensors.

    Joints that rest have none.
    """
    moving = [joint for joint in joints if joint not in resting]
    forces = [sensor_name(mechanism, joint, "force") for joint in moving]
    for joint, name in zip(moving, forces, strict=True):
        tables[name] = sensor_table(mechanism, joint, "force")
        # No machine is warm from the first moment on.
        tables[f"{identifier(joint)}_warming"] = {"joint": joint, "type": "warming"}
    if len(joints) == 1:
        add_mass(mechanism, joints[0], tables)
        return forces
    for joint in resting:
        tables[identifier(joint)]["effects"] = []
    for joint, name in zip(moving, forces, strict=True):
        # Several joints: a short list keeps the number of explanations small enough to tell apart.
        tables[identifier(joint)]["effects"] = PRESCRIBED
        tables[name]["effects"] = PRESCRIBED_FORCE
        add_rotor(joint, tables)
    add_tendons(mechanism, joints, tables)
    # What the last link holds has an inertia of its own, which measured forces show.
    add_links(mechanism, joints, ["mass", "inertia", "payload"], tables)
    return forces


def _add_movers(
    test: str,
    joints: Sequence[str],
    mechanism: Mechanism,
    tables: dict[str, dict[str, Any]],
    free: Sequence[str],
) -> list[str]:
    """Add the actuators of joints that commands move, and return their names."""
    movers: list[str] = []
    for joint in joints:
        actuator, name = actuator_on(mechanism, joint), actuator_name(mechanism, joint)
        if actuator is not None:
            falls = test == FORCES and mechanism.falls_with_speed(actuator)
            tables[name] = {
                "actuator": actuator,
                "type": VELOCITY_SERVO if falls else MOVERS[test],
            }
            movers.append(name)
        elif joint in free:
            tables[name] = {"joint": joint, "type": MOVERS[test], "effects": []}
            movers.append(name)
    return movers
