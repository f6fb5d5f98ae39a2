"""The measured positions of the joints, with their units."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rigtwin.describing.log import STATED, Log
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import Question, UnitQuestion, ask, enumerate_names, option
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.unit_by_force import unit_by_force
from rigtwin.describing.units import Unit, position_units
from rigtwin.description.joint_elements import movable_joints
from rigtwin.errors import RigtwinError
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
    question = ask(
        f"no column is named as the position of {enumerate_names(joints)}; the log has "
        f"{enumerate_names(names, 30)}",
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
            matched[joint] = match.column, 1.0, match.why
    # All at once: columns without a unit share one, and the widest range decides it.
    units = _units(log, {joint: column for joint, (column, _, _) in matched.items()})
    if units is None or len(signals) + len(matched) < len(joints):
        return None
    for joint, (column, sign, why) in matched.items():
        wrap = (
            _wrap(log.columns.values[column], units[joint]) if log.mechanism.turns(joint) else None
        )
        assumed = (units[joint].assumed,) if units[joint].assumed else ()
        if wrap is not None:
            assumed += (f"it jumps by a turn of {wrap:.4g}, so it is unwrapped",)
        signals[joint] = LogSignal(
            joint=joint,
            quantity=JointQuantity.POSITION,
            column=column,
            formula="",
            unit=units[joint].name,
            sign=sign,
            why=why,
            assumed=assumed,
            wrap=wrap,
        )
    return {joint: signals[joint] for joint in joints}


def _wrap(values: Array, unit: Unit) -> float | None:
    """Return the turn by which an angle jumps, in its unit; None of one that does not."""
    turn = 2.0 * math.pi / unit.factor
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
    try:
        return position_units(log.mechanism, log.columns, columns)
    except UnitQuestion as question:
        unit = unit_by_force(log, columns, question.units)
        if unit is not None:
            return dict.fromkeys(columns, unit)
        log.questions.append(str(question))
        return None
    except Question as question:
        log.questions.append(str(question))
        return None
