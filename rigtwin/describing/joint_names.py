"""The names by which a log can mean a joint: its own, and those of its actuators and sensors."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.describing.heading import split_words
from rigtwin.describing.quantity import COMMANDED, MEASURED, WORDS, JointQuantity
from rigtwin.description.implied import movable_joints
from rigtwin.description.mechanism import Mechanism

QUANTITY_WORDS = frozenset().union(*WORDS.values())
MEASURES = {
    "position": JointQuantity.POSITION,
    "velocity": JointQuantity.VELOCITY,
    "force": JointQuantity.FORCE,
}
"""Measure of an MJCF's sensor → quantity."""


@dataclass(frozen=True)
class Alias:
    """Name that means a joint.

    Parameters
    ----------
    joint
        Name of the joint.
    words
        Words of the alias.
    quantity
        Quantity that the whole name stands for, of a sensor or an actuator. None for a joint.
    name
        The name as the model has it.
    """

    joint: str
    words: tuple[str, ...]
    quantity: JointQuantity | None
    name: str


def list_aliases(mechanism: Mechanism) -> list[Alias]:
    """Return all names that mean a hinge or slide of a model.

    Of each name there is a second form without the words that say nothing of which joint it is,
    such as joint, servo, encoder or position.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    """
    joints = movable_joints(mechanism)
    named: list[tuple[str, str, JointQuantity | None]] = [(joint, joint, None) for joint in joints]
    for actuator in mechanism.names("actuator"):
        named.append((mechanism.joint_of("actuator", actuator), actuator, JointQuantity.COMMAND))
    for sensor in mechanism.names("sensor"):
        quantity = MEASURES.get(mechanism.measures(sensor))
        if quantity is not None:
            named.append((mechanism.joint_of("sensor", sensor), sensor, quantity))
    aliases: dict[tuple[str, tuple[str, ...]], Alias] = {}
    for joint, name, quantity in named:
        if joint not in joints:
            continue
        words = split_words(name)
        telling = tuple(word for word in words if word not in QUANTITY_WORDS | MEASURED | COMMANDED)
        # A number alone names no joint: every numbered column would fit it.
        short = telling if any(not word.isdigit() for word in telling) else ()
        for form in (words, short):
            if form:
                # The joint's own name comes first in the list, so an equal name of its sensor adds
                # nothing.
                aliases.setdefault((joint, form), Alias(joint, form, quantity, name))
    return list(aliases.values())
