"""Names that identify a joint in a log: its own, and those of its actuators and sensors."""

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
"""Quantity that an MJCF sensor measures, by the name of the measure."""


@dataclass(frozen=True)
class Alias:
    """Name that identifies a joint.

    Parameters
    ----------
    joint
        Name of the joint.
    words
        Words of the alias.
    quantity
        Quantity of the sensor or actuator with this name. None for the name of a joint.
    name
        Name as written in the model.
    """

    joint: str
    words: tuple[str, ...]
    quantity: JointQuantity | None
    name: str


def list_aliases(mechanism: Mechanism) -> list[Alias]:
    """Return all names that identify a hinge or slide of a model.

    Each name comes in two forms: complete, and without words that do not tell joints apart, such as
    joint, servo, encoder or position.

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
        # A number alone does not identify a joint: it would match any numbered column.
        short = telling if any(not word.isdigit() for word in telling) else ()
        for form in (words, short):
            if form:
                # The joint's own name comes first in the list, so an equal name of its sensor adds
                # nothing.
                aliases.setdefault((joint, form), Alias(joint, form, quantity, name))
    return list(aliases.values())
