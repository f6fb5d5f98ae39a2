"""Columns, units and formulas that the owner of a log states: `elbow.position=-q2 [deg]`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from rigtwin.describing.quantity import JointQuantity
from rigtwin.description.joint_elements import movable_joints
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import suggest
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.units import unit_of

NONE = "none"
"""Value that leaves a quantity out."""
TIME = "time"
ANY = "*"
"""Stands for every joint: `*.position=[deg]` states the unit of all positions."""
KEYS = {
    "position": JointQuantity.POSITION,
    "velocity": JointQuantity.VELOCITY,
    "force": JointQuantity.FORCE,
    "torque": JointQuantity.FORCE,
    "command": JointQuantity.COMMAND,
}
Slot = tuple[str, JointQuantity]
"""Joint and quantity."""


@dataclass(frozen=True)
class Stated:
    """Source of a quantity as the owner of the log states it.

    Parameters
    ----------
    column
        Column; empty where a formula is stated, or no source at all.
    formula
        Formula of columns, in SI, or a number; empty where a column is stated.
    unit
        Unit of the column; empty where it was not stated.
    sign
        1 or -1.
    """

    column: str
    formula: str
    unit: str
    sign: float


@dataclass(frozen=True)
class Corrections:
    """Everything that the owner of a log stated.

    Parameters
    ----------
    time
        Column or period of the rows; empty where neither was stated.
    slots
        Joint and quantity → source.
    units
        Quantity → unit, of all joints.
    """

    time: str = ""
    slots: Mapping[Slot, Stated] = field(default_factory=dict)
    units: Mapping[JointQuantity, str] = field(default_factory=dict)


def read_corrections(
    stated: Mapping[str, str], mechanism: Mechanism, columns: Columns
) -> Corrections:
    """Read what the owner of a log states.

    Parameters
    ----------
    stated
        Key → value: "elbow.position" → a column with or without a sign and a unit, a formula of
        columns, or "none"; "*.position" → a unit in brackets; "time" → a column or a period, s.
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.

    Raises
    ------
    RigtwinError
        For a joint, quantity or column that does not exist.
    """
    time, slots, units = "", {}, {}
    joints = movable_joints(mechanism)
    for key, text in stated.items():
        where = f"--column {key}={text}"
        if not isinstance(text, str):
            raise RigtwinError(f"{where}: expected a text")
        if key == TIME:
            time = text
            continue
        # From the right: names of joints may contain dots.
        owner, dot, name = key.rpartition(".")
        if not dot or name not in KEYS:
            known = [TIME, *(f"JOINT.{each}" for each in KEYS)]
            raise RigtwinError(f"{where}: {key!r} cannot be stated; {suggest(key, known)}")
        quantity = KEYS[name]
        if owner == ANY:
            units[quantity] = _unit(where, text)
            continue
        joint = _joint(owner, joints, mechanism)
        if joint is None:
            raise RigtwinError(f"{where}: no joint {owner!r}; {suggest(owner, joints)}")
        slots[joint, quantity] = _source(where, text.strip(), columns)
    return Corrections(time, slots, units)


def _joint(owner: str, joints: list[str], mechanism: Mechanism) -> str | None:
    """The joint that a name means: its own, or that of an actuator or a sensor."""
    if owner in joints:
        return owner
    for element in ("actuator", "sensor"):
        if owner in mechanism.names(element):
            return mechanism.joint_of(element, owner) or None
    return None


def _unit(where: str, text: str) -> str:
    match = re.fullmatch(r"\s*\[(.*)\]\s*", text)
    if match is None:
        raise RigtwinError(f"{where}: of all joints a unit can be stated, such as [deg]")
    unit_of(match.group(1))
    return match.group(1).strip()


def _source(where: str, text: str, columns: Columns) -> Stated:
    if text in ("", NONE):
        return Stated("", "", "", 1.0)
    unit = ""
    body = text
    # A column may itself end in brackets, as arrays do: q[3]. A number in brackets is therefore an
    # index unless it is a unit.
    if body not in columns.values and (match := re.fullmatch(r"(.*\S)\s*\[([^\]]*)\]", body)):
        try:
            unit_of(match.group(2))
        except RigtwinError:
            if not match.group(2).strip().isdigit():
                raise RigtwinError(f"{where}: unknown unit {match.group(2)!r}") from None
        else:
            body, unit = match.group(1), match.group(2).strip()
    # A column whose name begins with a minus comes first.
    for sign, prefix in ((1.0, ""), (-1.0, "-")):
        bare = body.removeprefix(prefix).strip() if body.startswith(prefix) else ""
        if bare in columns.values:
            return Stated(bare, "", unit, sign)
    try:
        float(body)
    except ValueError:
        pass
    else:
        return Stated("", body, unit, 1.0)
    # A formula names a column; without one, this is a column that is spelled wrong.
    if not any(name in body for name in columns.values):
        raise RigtwinError(f"{where}: no column {body!r}; {suggest(body, columns.values)}")
    return Stated("", body, unit, 1.0)
