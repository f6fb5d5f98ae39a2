"""Units of a log's columns: as the file or its owner states them, by name, or by range."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from rigtwin.describing.heading import split_words, stated_unit
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import UnitQuestion, ask, option
from rigtwin.description.joint_elements import actuator_on
from rigtwin.description.mechanism import Mechanism
from rigtwin.importing.columns import Columns
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array

BEYOND = 0.1
"""Share of a joint's range by which a log may be beyond its ends."""
WHOLE = 1.05 * 2.0 * math.pi
"""rad; a joint without a range is taken to stay within a turn either way."""
SURELY_DEGREES = 45.0
"""Numbers between a turn in rad and this one could be rad or degrees."""
SURELY_METRES, SURELY_MILLIMETRES = 3.0, 20.0
"""Numbers between these could be m or mm, of a joint without a range."""
PERCENT = "%"
"""Unit of a share, as files state it."""
LARGEST_PERCENT = 100.0
"""Some loggers write shares of a joint's range in percent."""
FEWEST_COUNTS = 20
"""Different positions of a joint from which the count of its encoder can be seen."""
COUNT_TOLERANCE = 0.03
"""Deviation of log2 of the number of counts of a turn from a whole number: 2 % of the count."""
ALIKE = 5.0
"""Largest ratio of the strokes of a command and of the position that follows it."""


@dataclass(frozen=True)
class Unit:
    """Unit of a column.

    Parameters
    ----------
    name
        Unit as a map has it.
    assumed
        Why it was concluded; empty where the file or its owner states it.
    scale
        Factor after conversion to SI, such as that of an actuator's gear.
    """

    name: str
    assumed: str = ""
    scale: float = 1.0

    @property
    def factor(self) -> float:
        """Factor to the quantity in SI."""
        return self.scale * unit_of(self.name)[1]


def known_unit(columns: Columns, column: str, si: str, key: str) -> Unit | None:
    """Return the unit that the file or a column's name states; None if neither does.

    Parameters
    ----------
    columns
        Columns of the log.
    column
        Name of the column.
    si
        SI unit of the quantity.
    key
        Name of the quantity, for a question.

    Raises
    ------
    Question
        If the file states the unit of another quantity, or percent.
    """
    written = columns.units.get(column, "")
    word = stated_unit(split_words(column))
    if _ambiguous_unit(column) and not written:
        raise ask(
            f"column {column!r} may be in degrees or in gon; which is it?",
            option(key, f"{column} [deg]"),
            option(key, f"{column} [gon]"),
        )
    if PERCENT in (written, word):
        raise ask(
            f"column {column!r} is in percent, and {key} is in {si}; how much is one percent?",
            option(key, f"FACTOR * {column}"),
        )
    if written and is_unit(written) and unit_of(written)[0] != "1":
        if unit_of(written)[0] == si:
            return Unit(written)
        raise ask(
            f"column {column!r} is in {written}, and {key} is in {si}; how much is one {written}?",
            option(key, f"FACTOR * {column}"),
            option(key, "COLUMN"),
        )
    if word and unit_of(word)[0] == si:
        return Unit(word, f"{word} by its name")
    return None


def _ambiguous_unit(column: str) -> bool:
    """Return whether a column's unit is "grad": the German degree, or a hundredth of 90 degrees."""
    return bool(re.search(r"[\[(_ ]grads?[\])]?$", column.lower()))


def position_units(
    mechanism: Mechanism, columns: Columns, positions: Mapping[str, str]
) -> dict[str, Unit]:
    """Return the units of measured positions.

    Positions without a stated unit are taken to have one unit in common: of all joints that turn,
    and of all that slide.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    positions
        Joint → column of its position.

    Raises
    ------
    UnitQuestion
        If two units are possible, which other signals may tell apart.
    Question
        If no unit is possible.
    """
    units: dict[str, Unit] = {}
    # Hinges and slides apart: one log can be in rad and mm.
    open_joints: dict[bool, list[str]] = {True: [], False: []}
    for joint, column in positions.items():
        turns = mechanism.turns(joint)
        known = known_unit(columns, column, SI[JointQuantity.POSITION][turns], f"{joint}.position")
        if known is not None:
            units[joint] = known
        else:
            open_joints[turns].append(joint)
    for turns, joints in open_joints.items():
        if joints:
            unit = _common_unit(mechanism, columns, positions, joints, turns)
            units |= {joint: unit for joint in joints}
    return units


def command_unit(columns: Columns, column: str, motion: Array, si: str, key: str) -> Unit:
    """Return the unit of a command, by the position or velocity that follows it.

    Parameters
    ----------
    columns
        Columns of the log.
    column
        Column of the command.
    motion
        Position or velocity of the joint, SI, shape (rows,).
    si
        SI unit of the motion.
    key
        Name of the command, for a question.

    Raises
    ------
    Question
        If no unit makes the strokes alike.
    """
    known = known_unit(columns, column, si, key)
    if known is not None:
        return known
    measured = "velocity" if si.endswith("/s") else "position"
    small = {"rad": "deg", "m": "mm", "rad/s": "deg/s", "m/s": "mm/s"}[si]
    stroke, followed = _stroke(columns.values[column]), _stroke(motion)
    if stroke == 0.0 or followed == 0.0:
        return Unit(si, f"{si}, as nothing moves")
    # SI first: strokes of 1 and 57.3 are a factor apart that no tracking error explains.
    for name in (si, small):
        if 1.0 / ALIKE < unit_of(name)[1] * stroke / followed < ALIKE:
            return Unit(name, f"{name} by the stroke of the {measured}")
    raise ask(
        f"column {column!r} has a stroke of {stroke:.4g}, and the {measured} that follows it "
        f"{followed:.4g} {si}; in what unit is it?",
        option(key, f"{column} [{small}]"),
        option(key, f"0.01 * {column}"),
    )


def _stroke(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


def _common_unit(
    mechanism: Mechanism,
    columns: Columns,
    positions: Mapping[str, str],
    joints: Sequence[str],
    turns: bool,
) -> Unit:
    """Unit that joints share whose columns do not state one."""
    si, small = ("rad", "deg") if turns else ("m", "mm")
    worst = {joint: _extremes(columns.values[positions[joint]]) for joint in joints}
    largest = max(max(abs(low), abs(high)) for low, high in worst.values())
    answers = [option("*.position", f"[{unit}]") for unit in (si, small)]
    beyond = next((j for j in joints if not _within(mechanism, j, worst[j], 1.0, turns)), None)
    # LeRobot writes "NAME.pos" as a share of the range, from −100 to 100: degrees look the same.
    percent = largest <= LARGEST_PERCENT and all(
        split_words(positions[j])[-1] == "pos" and "." in positions[j] for j in joints
    )
    if beyond is None:
        return Unit(si, f"{si} by its range")
    factor = unit_of(small)[1]
    outside = next((j for j in joints if not _within(mechanism, j, worst[j], factor, turns)), None)
    column = positions[beyond]
    reach = f"column {column!r} reaches from {worst[beyond][0]:.4g} to {worst[beyond][1]:.4g}"
    if outside is not None:
        column, (low, high) = positions[outside], worst[outside]
        question = ask(
            f"column {column!r} reaches from {low:.4g} to {high:.4g}, which is beyond the range of "
            f"joint {outside} in {si} and in {small}; is it counted at the motor, behind a gear?",
            option(f"{outside}.position", f"{column} / 32"),
            answers[1],
        )
        # A shaft without a range may turn on and on.
        raise question if _limited(mechanism, outside) else UnitQuestion(question, si, small)
    if percent and not _are_counts([columns.values[positions[joint]] for joint in joints]):
        raise ask(
            f"{reach}; is it degrees, or a share of the joint's range in percent?",
            answers[1],
            option(f"{beyond}.position", f"0.01745 * {column}"),
        )
    if _limited(mechanism, beyond):
        return Unit(small, f"{small} by its range, as {beyond} cannot be there in {si}")
    # The turn, or the metres, that such a joint is held to are an assumption: near it, the owner is
    # asked.
    names, surely = ("rad or degrees", SURELY_DEGREES) if turns else ("m or mm", SURELY_MILLIMETRES)
    question = ask(f"{reach}, and joint {beyond} has no range; are these {names}?", *answers)
    raise UnitQuestion(question, si, small, likely=largest >= surely)


def _are_counts(positions: Sequence[Array]) -> bool:
    """Whether several positions in degrees are multiples of one encoder's count.

    A turn in degrees has a power of two of such counts. Shares of the joints' ranges have another
    step at each joint.
    """
    steps = []
    for values in positions:
        differences = np.diff(np.unique(values[np.isfinite(values)]))
        if len(differences) < FEWEST_COUNTS:
            continue
        # Rounding in the file spreads the steps about the count.
        steps.append(float(np.mean(differences[differences < 1.5 * np.min(differences)])))
    counts = [math.log2(360.0 / step) for step in steps]
    return len(counts) > 1 and all(abs(n - round(n)) < COUNT_TOLERANCE for n in counts)


def _extremes(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)


def _limited(mechanism: Mechanism, joint: str) -> bool:
    return bool(mechanism.model.jnt_limited[mechanism.number("joint", joint)])


def _within(
    mechanism: Mechanism, joint: str, extremes: tuple[float, float], factor: float, turns: bool
) -> bool:
    """Whether a joint can be where a column says, in a unit of that factor."""
    low, high = factor * extremes[0], factor * extremes[1]
    if _limited(mechanism, joint):
        bottom, top = map(float, mechanism.model.jnt_range[mechanism.number("joint", joint)])
        slack = BEYOND * (top - bottom)
        return bottom - slack <= low and high <= top + slack
    # Without a range, a hinge stays within a turn and a slide within metres.
    limit = WHOLE if turns else SURELY_METRES
    return max(abs(low), abs(high)) <= limit


def force_unit(mechanism: Mechanism, columns: Columns, column: str, joint: str) -> Unit:
    """Return the unit of a force or torque.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    column
        Column of the force.
    joint
        Joint that the force acts on.

    Returns
    -------
    Unit
        Unit of the column. A hinge may be pushed by a force in N, and a slide by a torque in Nm,
        through the gear of its actuator, which is then the unit's scale.
    """
    si = SI[JointQuantity.FORCE][mechanism.turns(joint)]
    other = SI[JointQuantity.FORCE][not mechanism.turns(joint)]
    written = columns.units.get(column, "") or stated_unit(split_words(column))
    actuator = actuator_on(mechanism, joint)
    if is_unit(written) and unit_of(written)[0] == other and actuator is not None:
        gear = actuator_constant(mechanism, actuator)
        if gear and not mechanism.positions(actuator):
            text = f"{written}, times the gear of the model's actuator, {gear:g} {si}/{other}"
            return Unit(written, text, gear)
    known = known_unit(columns, column, si, f"{joint}.force")
    return known or Unit(si, f"{si}, as no unit is given")


def actuator_constant(mechanism: Mechanism, actuator: str) -> float:
    """Force of an actuator for each unit of its control, N or Nm, at the first joint it moves."""
    number = mujoco.mj_name2id(mechanism.model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator)
    model = mechanism.model
    # MuJoCo: force = gear · (gain · control + bias); a motor's bias is zero.
    force = float(model.actuator_gear[number, 0]) * float(model.actuator_gainprm[number, 0])
    moved = mechanism.acts_on("actuator", actuator) if actuator else ()
    return force * moved[0][1] if moved else force


def largest_control(mechanism: Mechanism, actuator: str) -> float | None:
    """Return the largest control of an actuator by its range; None where it has none."""
    number = mujoco.mj_name2id(mechanism.model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator)
    if number < 0 or not mechanism.model.actuator_ctrllimited[number]:
        return None
    return float(np.abs(mechanism.model.actuator_ctrlrange[number]).max())
