"""The measured positions of the joints, with their units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.describing.counts import count_unit
from rigtwin.describing.log import STATED, Log, bridge
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import Question, UnitQuestion, ask, enumerate_names, option
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.unit_by_force import unit_by_force
from rigtwin.describing.unit_by_velocity import unit_by_velocity
from rigtwin.describing.units import Unit, position_units
from rigtwin.description.joint_elements import movable_joints
from rigtwin.errors import RigtwinError
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

JUMP, WITHIN = 0.8, 1.02
"""Smallest jump of a wrapped angle, and largest range of its values, in turns."""


def ask_positions(log: Log) -> None:
    """Ask for the positions of the joints, of which no column is named.

    Parameters
    ----------
    log
        The log.
    """
    joints = movable_joints(log.mechanism)
    if not joints:
        raise RigtwinError("the model has no hinge or slide with a name; expected one at least")
    names = [name for name in log.columns.values if name != log.time_column]
    refused = "".join(f"; column {name!r}: {why}" for name, why in log.columns.refused.items())
    question = ask(
        f"no column is named as the position of {enumerate_names(joints)}; the log has "
        f"{enumerate_names(names, 30) or 'no other column than the time'}{refused}",
        option(f"{joints[0]}.position", "COLUMN"),
    )
    log.questions.append(str(question))


def position_signals(log: Log, joints: Sequence[str]) -> dict[str, LogSignal] | None:
    """Return the positions of joints; None where a question is open.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joints
        Joints whose position it offers.
    """
    signals: dict[str, LogSignal] = {}
    matched: dict[str, tuple[str, float, str]] = {}
    gears: dict[str, float] = {}
    for joint in joints:
        source = log.slots.stated(joint, JointQuantity.POSITION)
        if source is not None and (source.formula or source.unit):
            signals[joint] = log.stated_signal(joint, JointQuantity.POSITION)
        elif source is not None:
            matched[joint] = source.column, source.sign, STATED
        else:
            try:
                match = log.slots.match(joint, JointQuantity.POSITION)
            except Question as question:
                log.questions.append(str(question))
                continue
            matched[joint], gears[joint] = (match.column, 1.0, match.why), match.gear
    for joint, (column, _, _) in matched.items():
        if not np.isfinite(log.columns.values[column]).any():
            raise RigtwinError(
                f"column {column!r}, the position of joint {joint}, holds no number; expected one "
                "in most rows"
            )
    # All at once: columns without a unit share one, and the widest range decides it.
    units = _units(log, {joint: column for joint, (column, _, _) in matched.items()})
    if units is None or len(signals) + len(matched) < len(joints):
        return None
    for joint, (column, sign, why) in matched.items():
        gear = gears.get(joint, 1.0)
        geared = () if gear == 1.0 else (f"before the gear of the model's actuator: over {gear:g}",)
        signals[joint] = LogSignal(
            joint=joint,
            quantity=JointQuantity.POSITION,
            column=column,
            unit=units[joint].name,
            sign=sign,
            why=why,
            assumed=(*((units[joint].assumed,) if units[joint].assumed else ()), *geared),
            scale=units[joint].scale / gear,
        )
    return {joint: _unwrap(log, signals[joint]) for joint in joints}


def _unwrap(log: Log, signal: LogSignal) -> LogSignal:
    """Return the signal of an angle that jumps by a turn as one that is to be unwrapped."""
    if signal.formula or not log.mechanism.turns(signal.joint):
        return signal
    wrap = _wrap(log.columns.values[signal.column], unit_of(signal.unit)[1])
    if wrap is None:
        return signal
    text = f"it jumps by a turn of {wrap:.4g}, so it is unwrapped"
    return replace(signal, wrap=wrap, assumed=(*signal.assumed, text))


def _wrap(values: Array, factor: float) -> float | None:
    """Return the turn by which an angle jumps, in its unit; None of one that does not.

    `factor` converts the unit to rad.
    """
    turn = 2.0 * math.pi / factor
    known = values[np.isfinite(values)]
    steps = np.abs(np.diff(known))
    jumps = steps > JUMP * turn
    # An angle that is wrapped stays within a turn, and moves little between its jumps.
    wrapped = jumps.any() and np.ptp(known) <= WITHIN * turn
    return turn if wrapped and np.median(steps) < (1.0 - JUMP) * turn else None


def _units(log: Log, columns: dict[str, str]) -> dict[str, Unit] | None:
    general = log.stated.units.get(JointQuantity.POSITION)
    if general is not None:
        return dict.fromkeys(columns, Unit(general))
    units: dict[str, Unit] = {}
    try:
        for joint, column in columns.items():
            turns = log.mechanism.turns(joint)
            unit = count_unit(log.columns, column, turns, f"{joint}.position")
            units |= {joint: unit} if unit is not None else {}
    except Question as question:
        log.questions.append(str(question))
        return None
    # Slides first: their unit, m or mm, is seldom in doubt.
    for turns in (False, True):
        alike = {
            joint: column
            for joint, column in columns.items()
            if log.mechanism.turns(joint) is turns and joint not in units
        }
        known = {
            joint: unit.factor * bridge(log.columns.values[columns[joint]])
            for joint, unit in units.items()
        }
        common = _units_alike(log, alike, known) if alike else {}
        if common is None:
            return None
        units |= common
    return units


def _units_alike(
    log: Log, columns: dict[str, str], known: Mapping[str, Array]
) -> dict[str, Unit] | None:
    """Return the units of joints that all turn or all slide; None with a question noted.

    `known` maps joints of the other kind to their positions, SI.
    """
    try:
        return position_units(log.mechanism, log.columns, columns)
    except Question as question:
        if isinstance(question, UnitQuestion):
            unit = unit_by_velocity(log, columns, question.units)
            unit = unit or unit_by_force(log, columns, question.units, known)
            if unit is None and question.likely:
                small = question.units[-1]
                unit = Unit(small, f"{small} by its range, as the joint has none of its own")
            if unit is not None:
                return dict.fromkeys(columns, unit)
        log.questions.append(str(question))
        return None
