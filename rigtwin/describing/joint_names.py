"""Names that identify a joint in a log: its own, and those of its actuators and sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rigtwin.describing.heading import split_words
from rigtwin.describing.quantity import (
    COMMANDED,
    COORDINATES,
    MEASURED,
    TIME,
    UNIT_WORDS,
    WORDS,
    JointQuantity,
)
from rigtwin.description.joint_elements import body_of, movable_joints
from rigtwin.description.mechanism import Mechanism

SHORTEST_WORD = 3
"""Characters of the shortest word that identifies a joint by itself."""
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
    is_part
        Whether the alias is one word of a longer name.
    gear
        Reading of the sensor with this name per unit of the joint's position or velocity.
    """

    joint: str
    words: tuple[str, ...]
    quantity: JointQuantity | None
    name: str
    is_part: bool = False
    gear: float = 1.0


def list_aliases(mechanism: Mechanism) -> list[Alias]:
    """Return all names that identify a hinge or slide of a model.

    These are the names of the joint, of its actuators and sensors, and of the body that it moves
    alone. Each name comes in several forms: complete, without words that do not tell joints apart,
    such as joint, servo, encoder or position, and without those that all joints share, such as the
    name of the robot. A word that belongs to the name of one joint alone identifies it as well, as
    the hip of hip_pitch does beside a knee.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    """
    joints = movable_joints(mechanism)
    named = [Alias(joint, (), None, joint) for joint in joints]
    for actuator in mechanism.names("actuator"):
        joint = mechanism.joint_of("actuator", actuator)
        named.append(Alias(joint, (), JointQuantity.COMMAND, actuator))
    for sensor in mechanism.names("sensor"):
        quantity = MEASURES.get(mechanism.measures(sensor))
        if quantity is not None:
            joint, gear = mechanism.joint_of("sensor", sensor), mechanism.sensor_gear(sensor)
            named.append(Alias(joint, (), quantity, sensor, gear=gear))
    shared = frozenset[str]()
    if len(joints) > 1:
        shared = frozenset.intersection(*(frozenset(split_words(joint)) for joint in joints))
    aliases: dict[tuple[str, tuple[str, ...]], Alias] = {}
    for element in named:
        for form in _forms(element.name, shared) if element.joint in joints else ():
            # The joint's own name comes first in the list, so an equal name of its sensor adds
            # nothing.
            aliases.setdefault((element.joint, form), replace(element, words=form))
    # A body can have the name of another joint, such as the elbow's housing on the shoulder.
    taken = {form for _, form in aliases}
    for joint, body in _bodies(mechanism, joints).items():
        for form in _forms(body, shared):
            if form not in taken:
                aliases.setdefault((joint, form), Alias(joint, form, None, f"body {body}"))
    for joint, word in _distinctive_words(joints, list(aliases.values())):
        alias = Alias(joint, (word,), None, f"{word} of {joint}", is_part=True)
        aliases.setdefault((joint, (word,)), alias)
    return list(aliases.values())


def read_abbreviations(
    headings: Sequence[tuple[str, ...]], aliases: Sequence[Alias]
) -> dict[str, str]:
    """Return the abbreviated words of joints' names in the headings of a log → words in full.

    An abbreviation is the beginning of one word of the names alone, as "susp" is of suspension.
    One of two letters could be anything, so that several joints must be abbreviated like that: "az"
    and "el" of azimuth and elevation.

    Parameters
    ----------
    headings
        Words of every heading.
    aliases
        Names of the joints.
    """
    names = {word for alias in aliases for word in alias.words}
    known = (
        names | QUANTITY_WORDS | MEASURED | COMMANDED | COORDINATES | TIME | frozenset(UNIT_WORDS)
    )
    long: dict[str, str] = {}
    short: dict[str, str] = {}
    for word in dict.fromkeys(word for words in headings for word in words):
        if len(word) < SHORTEST_WORD - 1 or word.isdigit() or word in known:
            continue
        complete = [name for name in names if name.startswith(word)]
        if len(complete) == 1:
            (long if len(word) >= SHORTEST_WORD else short)[word] = complete[0]
    joints = {alias.joint for alias in aliases if set(alias.words) & {*short.values()}}
    return long | short if len(joints) > 1 else long


def _distinctive_words(joints: Sequence[str], aliases: Sequence[Alias]) -> list[tuple[str, str]]:
    """Joints, and the words of their own names that no alias of another joint contains.

    A word such as motor, which names parts of any joint, counts where the name has no other, as of
    motor_shaft beside load_shaft, or where another joint has no other name, as link_joint.
    """
    vocabulary = {
        joint: {word for alias in aliases if alias.joint == joint for word in alias.words}
        for joint in joints
    }
    plain = QUANTITY_WORDS | MEASURED | COMMANDED | COORDINATES
    distinctive = {
        joint: [
            word
            for word in split_words(joint)
            if len(word) >= SHORTEST_WORD
            and not word.isdigit()
            and not any(word in vocabulary[other] for other in joints if other != joint)
        ]
        for joint in joints
    }
    plain_counts = any(words and plain.issuperset(words) for words in distinctive.values())
    return [
        (joint, word)
        for joint, words in distinctive.items()
        for word in words
        if word not in COMMANDED and (word not in plain or plain_counts)
    ]


def _forms(name: str, shared: frozenset[str]) -> list[tuple[str, ...]]:
    """Forms of a name, as words; shared: words that all joints have in common."""
    words = split_words(name)
    telling = tuple(word for word in words if word not in QUANTITY_WORDS | MEASURED | COMMANDED)
    plain = tuple(word for word in telling if word not in shared)
    return [form for form in (words, _identifying(telling), _identifying(plain)) if form]


def _bodies(mechanism: Mechanism, joints: Sequence[str]) -> dict[str, str]:
    """Joint → body that it moves alone, such as the cart on its slide."""
    bodies = {joint: body_of(mechanism, joint) for joint in joints}
    moved = list(bodies.values())
    return {joint: body for joint, body in bodies.items() if body and moved.count(body) == 1}


def _identifying(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return the words, or none if they are numbers alone, which match any numbered column."""
    return words if any(not word.isdigit() for word in words) else ()
