"""References of a controller, which are no commands of an actuator that takes a force.

A drive with a current loop logs its position's setpoint beside the current. The setpoint is named
like a command, and the model's motor does not take it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.describing.heading import split_words, stated_unit
from rigtwin.describing.log import Log
from rigtwin.describing.quantity import REFERENCES, SI, JointQuantity
from rigtwin.description.joint_elements import actuator_on
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array

GIVEN = (
    JointQuantity.FORCE,
    JointQuantity.CURRENT,
    JointQuantity.FORCE_COMMAND,
    JointQuantity.CURRENT_COMMAND,
    JointQuantity.VOLTAGE,
)
"""Quantities of what an actuator gives, or is given by its controller."""
FOLLOWED = 0.3
"""Deviation of a position from its reference, as a share of the position's standard deviation,
up to which the joint follows it."""


def withdraw_references(log: Log, positions: Mapping[str, Array]) -> None:
    """Withdraw the setpoints of positions from the commands of actuators that take none.

    A column is a setpoint if its unit is that of a position, or if its name says so and either the
    log holds what the actuator gives or the joint's position follows the column in value.

    Parameters
    ----------
    log
        The log, from whose slots the columns are taken.
    positions
        Joint → position, SI, shape (rows,).
    """
    for joint, position in positions.items():
        actuator = actuator_on(log.mechanism, joint)
        if actuator is None or log.mechanism.positions(actuator):
            continue
        for column in log.slots.columns(joint, JointQuantity.COMMAND):
            if _is_reference(log, column, joint, position):
                log.slots.withdraw(column)
                log.unused[column] = (
                    "a position's setpoint, and the model's actuator takes no position"
                )


def _is_reference(log: Log, column: str, joint: str, position: Array) -> bool:
    words = split_words(column)
    stated = log.columns.units.get(column, "") or stated_unit(words)
    if is_unit(stated) and unit_of(stated)[0] in SI[JointQuantity.POSITION]:
        return True
    if not REFERENCES & set(words):
        return False
    if any(log.slots.has(joint, quantity) for quantity in GIVEN):
        return True
    # Without a unit of its own, a setpoint shares the unit of the position's column.
    measured = log.slots.columns(joint, JointQuantity.POSITION)
    raw = log.columns.values[measured[0]] if measured else position
    spread = float(np.nanstd(raw))
    deviation = float(np.sqrt(np.nanmean((log.columns.values[column] - raw) ** 2)))
    return 0.0 < deviation <= FOLLOWED * spread
