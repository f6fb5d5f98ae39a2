"""Columns that friction or a force may follow, such as a temperature or the voltage of a damper."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.describing.heading import split_words
from rigtwin.describing.log import Log
from rigtwin.description.joint_elements import actuator_on, identifier

ENVIRONMENT = frozenset({"temp", "temperature", "pressure", "humidity"})
"""Words for quantities on which friction may depend."""
ELECTRIC = frozenset({"voltage", "volt", "volts", "current", "amps"})
"""Words for what controls a damper or a brake, where no motor moves the joint."""

LEAST_VARIATION = 0.1
"""Smallest range of a column, as a share of its largest magnitude: forces that follow a column that
hardly varies look like constant friction."""


@dataclass(frozen=True)
class ScheduleColumn:
    """Column of a log that forces at a joint may follow.

    Parameters
    ----------
    column
        Name of the column.
    joint
        Joint at which forces may follow it; empty where several are possible.
    name
        Name of the component and of its channel.
    unit
        Unit that the file states; empty if it states none.
    """

    column: str
    joint: str
    name: str
    unit: str


def schedule_columns(
    log: Log, joints: Sequence[str], used: Collection[str]
) -> tuple[ScheduleColumn, ...]:
    """Return the columns that forces may follow.

    Parameters
    ----------
    log
        The log.
    joints
        Joints that take part.
    used
        Columns that have another meaning.
    """
    schedules: list[ScheduleColumn] = []
    # Names of joints, actuators, sensors and bodies are those of other components.
    taken = {
        identifier(name)
        for element in ("joint", "actuator", "sensor", "body", "tendon")
        for name in log.mechanism.names(element)
    }
    for column, values in log.columns.values.items():
        words = set(split_words(column))
        joint = _joint_of(words, joints)
        moved = [actuator_on(log.mechanism, name) for name in ([joint] if joint else joints)]
        # The voltage of a motor grows with the force that is asked of it, and is no cause.
        meaning = ENVIRONMENT if any(moved) else ENVIRONMENT | ELECTRIC
        if column in used or not words & meaning or not np.all(np.isfinite(values)):
            continue
        if np.ptp(values) > LEAST_VARIATION * np.max(np.abs(values)):
            name = identifier(column)
            while name in taken:
                name = f"{name}_column"
            taken.add(name)
            unit = log.columns.units.get(column, "")
            schedules.append(ScheduleColumn(column, joint, name, unit))
    return tuple(schedules)


def _joint_of(words: Collection[str], joints: Sequence[str]) -> str:
    named = [joint for joint in joints if set(split_words(joint)) <= set(words)]
    candidates = named or list(joints)
    return candidates[0] if len(candidates) == 1 else ""
