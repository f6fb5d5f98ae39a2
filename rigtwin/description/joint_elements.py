"""Elements of a model that belong to a joint, and the names of the components that they imply."""

from __future__ import annotations

import re
from collections.abc import Sequence

import mujoco

from rigtwin.description.coupling import are_coupled
from rigtwin.description.mechanism import Mechanism


def movable_joints(mechanism: Mechanism) -> list[str]:
    """Return the names of the hinges and slides of a model, in the order of the model."""
    model = mechanism.model
    # Free and ball joints have several coordinates, which no channel holds.
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    numbers = [n for n in range(model.njnt) if int(model.jnt_type[n]) in single]
    return [name for n in numbers if (name := mechanism.joint_name(n))]


def actuator_on(mechanism: Mechanism, joint: str) -> str | None:
    """Return the name of the actuator that acts on a joint; None without a named one.

    A motor or servo that pulls a fixed tendon counts as that of the first joint that the tendon
    passes.
    """
    for name in mechanism.names("actuator"):
        if mechanism.joint_of("actuator", name) == joint:
            return name
    pulling = [
        name for name in _tendon_actuators(mechanism) if _passed(mechanism, name)[0] == joint
    ]
    return pulling[0] if pulling else None


def _tendon_actuators(mechanism: Mechanism) -> list[str]:
    """Return the motors and servos on fixed tendons that pass no joint with another actuator."""
    passed = {name: _passed(mechanism, name) for name in mechanism.names("actuator")}
    moved = [joint for joints in passed.values() for joint in joints]
    return [
        name
        for name, joints in passed.items()
        if mechanism.tendon_of("actuator", name) is not None
        # A servo with a gear has a law of its own.
        and (not mechanism.positions(name) or mechanism.servo(name) is not None)
        and not mechanism.falls_with_speed(name)
        and joints
        # The force at a joint that several actuators move does not follow from one command.
        and all(moved.count(joint) == 1 for joint in joints)
    ]


def _passed(mechanism: Mechanism, actuator: str) -> list[str]:
    """Return the joints on which an actuator acts; none if it acts on none linearly."""
    return [joint for joint, _ in mechanism.acts_on("actuator", actuator)]


def sensor_on(mechanism: Mechanism, joint: str, measured: str) -> str | None:
    """Return the name of the sensor of a joint's position, velocity or force; None without one."""
    known = [
        name
        for name in mechanism.names("sensor")
        if mechanism.joint_of("sensor", name) == joint and mechanism.measures(name) == measured
    ]
    # What the joint itself does is measured behind the gear of its actuator.
    return min(known, key=lambda name: mechanism.sensor_gear(name) != 1.0, default=None)


def sensor_name(mechanism: Mechanism, joint: str, measured: str) -> str:
    """Return the name of the implied sensor of a joint's position, velocity or force."""
    known = sensor_on(mechanism, joint, measured)
    name = identifier(known) if known else f"{identifier(joint)}_{measured}"
    # The joint's own component has the joint's name.
    return f"{name}_{measured}" if name == identifier(joint) else name


def actuator_name(mechanism: Mechanism, joint: str) -> str:
    """Return the name of the implied actuator of a joint."""
    # MJCF allows a joint, a sensor and an actuator of the same name; components do not.
    name = identifier(actuator_on(mechanism, joint) or joint)
    taken = {identifier(joint) for joint in movable_joints(mechanism)}
    taken |= {identifier(sensor) for sensor in mechanism.names("sensor")}
    return f"{name}_actuator" if name in taken else name


def swinging(mechanism: Mechanism, joints: Sequence[str]) -> list[str]:
    """Return the joints that swing freely: no actuator acts on them or on joints coupled to them.

    Each has a force actuator of its own, whose command is 0 throughout.
    """
    lacking = [joint for joint in joints if actuator_on(mechanism, joint) is None]
    if len(lacking) < len(joints) and are_coupled(mechanism, joints):
        return []
    return lacking


def identifier(name: str) -> str:
    """Return a name of the model as the name of a component: letters, digits and _."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return plain if re.match(r"[A-Za-z]", plain) else f"n{plain}"


def body_of(mechanism: Mechanism, joint: str) -> str | None:
    """Return the name of the body that moves with a joint; None for a body without a name."""
    number = int(mechanism.model.jnt_bodyid[mechanism.number("joint", joint)])
    return mujoco.mj_id2name(mechanism.model, mujoco.mjtObj.mjOBJ_BODY, number)
