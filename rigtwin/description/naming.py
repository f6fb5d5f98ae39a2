"""Names of joints and actuators that an MJCF leaves without one."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco

MOVING = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
"""Types of joints that move along or about one axis, as a compiled model numbers them."""


def lacks_names(model: mujoco.MjModel) -> bool:
    """Return whether a hinge or slide of a model, its body or an actuator has no name.

    Parameters
    ----------
    model
        Compiled model.
    """
    joints = [number for number in range(model.njnt) if model.jnt_type[number] in MOVING]
    unnamed = [not model.joint(number).name for number in joints]
    unnamed += [not model.body(model.jnt_bodyid[number]).name for number in joints]
    unnamed += [not model.actuator(number).name for number in range(model.nactuator)]
    return any(unnamed)


def name_elements(spec: mujoco.MjSpec) -> None:
    """Name the joints after their bodies or the reverse, and actuators after what they act on.

    Parameters
    ----------
    spec
        Specification of a model, whose elements without a name receive one.
    """
    # MuJoCo tells joints and actuators of the same name apart, so each has a list of its own.
    taken = {joint.name for joint in spec.joints}
    for joint in spec.joints:
        if not joint.name and int(joint.type) in MOVING:
            joint.name = _choose(f"{joint.parent.name or 'body'}_joint", taken)
    taken = {body.name for body in spec.bodies}
    for joint in spec.joints:
        if not joint.parent.name and int(joint.type) in MOVING:
            joint.parent.name = _choose(f"{joint.name}_body", taken)
    taken = {actuator.name for actuator in spec.actuators}
    for actuator in spec.actuators:
        if not actuator.name:
            actuator.name = _choose(f"{actuator.target or 'model'}_actuator", taken)


def _choose(name: str, taken: set[str]) -> str:
    """Return a name, with a number where it is taken already, and note it as taken."""
    choices: Iterable[str] = (name, *(f"{name}_{number}" for number in range(2, len(taken) + 3)))
    chosen = next(choice for choice in choices if choice not in taken)
    taken.add(chosen)
    return chosen
