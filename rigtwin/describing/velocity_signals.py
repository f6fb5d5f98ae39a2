"""The measured velocities of joints whose position no column holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.describing.log import Log
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import Question, ask, option
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.units import Unit, known_unit
from rigtwin.description.coupling import are_coupled
from rigtwin.description.joint_elements import movable_joints
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

SURELY_SI = 100.0
"""Velocity up to which numbers without a unit are in rad/s or m/s."""


def joints_by_velocity(log: Log) -> list[str]:
    """Return the joints that a log without any position describes by their velocities.

    Parameters
    ----------
    log
        The log. A question is added to it where the velocity of a joint does not suffice.
    """
    mechanism = log.mechanism
    joints = log.slots.joints(JointQuantity.VELOCITY, movable_joints(mechanism))
    # The load of gravity and the inertia of coupled joints depend on where the joints are.
    placed = [joint for joint in joints if np.any(mechanism.joint(joint).gravity)]
    placed = list(joints) if are_coupled(mechanism, joints) else placed
    if not placed:
        return joints
    question = ask(
        f"no column is named as the position of {placed[0]}, and its load depends on that, so a "
        "velocity does not suffice",
        option(f"{placed[0]}.position", "COLUMN"),
        option(f"{placed[0]}.position", "integral(VELOCITY)") + " if it begins at zero",
    )
    log.questions.append(str(question))
    return []


def velocity_signals(log: Log, joints: Sequence[str]) -> dict[str, LogSignal] | None:
    """Return the measured velocities of joints; None where a question is open.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joints
        Joints whose velocity it offers.
    """
    signals: dict[str, LogSignal] = {}
    for joint in joints:
        try:
            signals[joint] = _signal(log, joint)
        except Question as question:
            log.questions.append(str(question))
    return signals if len(signals) == len(joints) else None


def _signal(log: Log, joint: str) -> LogSignal:
    if log.slots.stated(joint, JointQuantity.VELOCITY) is not None:
        return log.stated_signal(joint, JointQuantity.VELOCITY)
    match = log.slots.match(joint, JointQuantity.VELOCITY)
    if not np.isfinite(log.columns.values[match.column]).any():
        raise RigtwinError(
            f"column {match.column!r}, the velocity of joint {joint}, holds no number; expected "
            "one in most rows"
        )
    unit = _unit(log, joint, match.column)
    return LogSignal(
        joint=joint,
        quantity=JointQuantity.VELOCITY,
        column=match.column,
        unit=unit.name,
        why=match.why,
        assumed=(unit.assumed,) if unit.assumed else (),
    )


def _unit(log: Log, joint: str, column: str) -> Unit:
    general = log.stated.units.get(JointQuantity.VELOCITY)
    if general is not None:
        return Unit(general)
    key, turns = f"{joint}.velocity", log.mechanism.turns(joint)
    si = SI[JointQuantity.VELOCITY][turns]
    known = known_unit(log.columns, column, si, key)
    if known is not None:
        return known
    largest = float(np.nanmax(np.abs(log.columns.values[column]), initial=0.0))
    if largest <= SURELY_SI:
        return Unit(si, f"{si}, as no unit is given")
    others = ("rpm", "deg/s") if turns else ("mm/s",)
    raise ask(
        f"column {column!r} reaches {largest:.4g}; in what unit is it?",
        *(option(key, f"{column} [{unit}]") for unit in (*others, si)),
    )


def integrate(velocity: Array, time: Array) -> Array:
    """Return the position that begins at zero and has a velocity, by the trapezoidal rule.

    Parameters
    ----------
    velocity
        Velocity, m/s or rad/s, shape (rows,).
    time
        Time of the rows, s, shape (rows,).
    """
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])
