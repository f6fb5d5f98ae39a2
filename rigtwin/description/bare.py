"""Description of a machine that is stated by its model alone: an MJCF or URDF without a TOML file.

Joints that position actuators move are pushed by servos, and their positions are predicted. All
other joints move as demanded, and the forces that this takes are predicted.
"""

from __future__ import annotations

import json
from pathlib import Path

from rigtwin.description.document import examine_text
from rigtwin.description.implied import INVERSE, SERVOS
from rigtwin.description.joint_elements import actuator_on, movable_joints
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError

MODELS = (".xml", ".mjcf", ".urdf")
"""Endings of models that MuJoCo reads."""


def name_machine(model_name: str, stem: str) -> str:
    """Return the name of a machine: letters, digits, - and _.

    Parameters
    ----------
    model_name
        Name that the model states.
    stem
        Name of the model's file without its ending.
    """
    for text in (model_name, stem):
        plain = "-".join("".join(c if c.isalnum() and c.isascii() else " " for c in text).split())
        if plain and text not in ("MuJoCo Model", ""):
            return plain
    return "machine"


def model_name(mechanism: Mechanism) -> str:
    """Return the name that an MJCF states, the first of the model's names."""
    return mechanism.model.names.split(b"\0", 1)[0].decode("utf-8", "replace")


def describe_model(model: Path) -> Machine:
    """Return the machine that a model is, with nothing but what the model states.

    Parameters
    ----------
    model
        Path of an MJCF or URDF.

    Raises
    ------
    RigtwinError
        If the model cannot be read, has no hinge or slide with a name, or has parts that the
        models of a machine lack. The message states the first obstacle.
    """
    mechanism = Mechanism(model)
    joints = movable_joints(mechanism)
    if not joints:
        raise RigtwinError(f"{model}: it has no hinge or slide with a name, so nothing moves")
    test = SERVOS if all(_has_servo(mechanism, joint) for joint in joints) else INVERSE
    name = name_machine(model_name(mechanism), model.stem)
    text = (
        f'[machine]\nname = "{name}"\nmodel = {json.dumps(model.name)}\nnominal = "rough"\n\n'
        f'[[replays]]\ntest = "{test}"\n'
    )
    machine, mistakes = examine_text(text, model)
    if machine is None:
        raise RigtwinError(f"{model}: {mistakes[0]}")
    return machine


def _has_servo(mechanism: Mechanism, joint: str) -> bool:
    """Return whether a position actuator that the models can compute moves a joint."""
    actuator = actuator_on(mechanism, joint)
    return (
        actuator is not None
        and mechanism.positions(actuator)
        and mechanism.servo(actuator) is not None
    )
