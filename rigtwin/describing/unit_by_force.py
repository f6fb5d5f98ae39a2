"""The unit of positions, by the forces that the model needs for the motion.

An inertia needs 57.3 times the torque for a motion in rad that it needs for the same numbers in
degrees, and 1000 times the force for metres instead of millimetres. Hardly another error is as
large. A torque before a gear may be: there, only the right unit gives gravity the right course.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.describing.checks import force_slopes
from rigtwin.describing.log import Log, bridge
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import Question
from rigtwin.describing.units import Unit, actuator_constant, force_unit
from rigtwin.description.joint_elements import actuator_on
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

CLEAR, POOR = 0.8, 0.3
"""Share of the forces that the model explains with the right unit, and at most with any other, to
tell the unit whatever the ratio."""
WORSE = 10.0
"""Factor on the share of the forces that the model leaves unexplained with any other unit, from
which the unit is told as well."""
SHOWN = 0.1
"""Share of a force that the model must explain to count."""
CLOSE, FAR = 5.0, 8.0
"""Ratio of measured to required force up to which a unit may be right, and from which it is wrong;
the same for its inverse."""
FORCES = (JointQuantity.FORCE, JointQuantity.FORCE_COMMAND, JointQuantity.COMMAND)
"""Quantities that may be the force at a joint, the surest first."""


def unit_by_force(
    log: Log, columns: Mapping[str, str], units: Sequence[str], known: Mapping[str, Array]
) -> Unit | None:
    """Return the unit in which the model needs the forces that the log holds.

    Parameters
    ----------
    log
        The log.
    columns
        Joint → column of its position.
    units
        Units that are possible.
    known
        Joint → position of a joint whose unit is known, SI, shape (rows,).

    Returns
    -------
    Unit or None
        None where the log holds no force, or where the forces do not tell.
    """
    forces = _forces(log, list(columns))
    if log.clock is None or not forces:
        return None
    ratios, explained = {}, {}
    for unit in units:
        positions = dict(known) | {
            joint: unit_of(unit)[1] * bridge(log.columns.values[column])
            for joint, column in columns.items()
        }
        slopes = force_slopes(log.mechanism, log.time(), positions, forces)
        explained[unit] = min((slope.explained for slope in slopes.values()), default=0.0)
        shown = [abs(slope.slope) for slope in slopes.values() if slope.explained > SHOWN]
        if shown:
            ratios[unit] = float(np.median(shown))
    if not ratios:
        return None
    clearest = max(explained, key=lambda unit: explained[unit])
    least = 1.0 - explained[clearest]
    rivals = [share for unit, share in explained.items() if unit != clearest]
    if explained[clearest] > CLEAR and all(
        share <= POOR or 1.0 - share > WORSE * least for share in rivals
    ):
        share = 100.0 * explained[clearest]
        return Unit(
            clearest, f"{clearest} by the forces, of which the model explains {share:.0f} %"
        )
    misses = {unit: abs(math.log(ratio)) for unit, ratio in ratios.items()}
    best = min(misses, key=lambda unit: misses[unit])
    others = [miss for unit, miss in misses.items() if unit != best]
    if misses[best] > math.log(CLOSE) or any(miss < math.log(FAR) for miss in others):
        return None
    return Unit(best, f"{best} by the forces, which are {ratios[best]:.2g} times the model's")


def _forces(log: Log, joints: Sequence[str]) -> dict[str, Array]:
    """Joint → force of the log at it, N or Nm, without joints whose force is unknown."""
    forces = {joint: _force(log, joint) for joint in joints}
    return {joint: force for joint, force in forces.items() if force is not None and np.any(force)}


def _force(log: Log, joint: str) -> Array | None:
    """Measured force at a joint, or that of its motor's command; None where neither is known."""
    motor = actuator_on(log.mechanism, joint)
    if motor is not None and log.mechanism.positions(motor):
        motor = None
    for quantity in FORCES:
        if quantity is not JointQuantity.FORCE and motor is None:
            continue
        if not log.slots.has(joint, quantity):
            continue
        if log.slots.stated(joint, quantity) is not None:
            force = log.values(log.stated_signal(joint, quantity))
        else:
            try:
                column = log.slots.match(joint, quantity).column
                unit = force_unit(log.mechanism, log.columns, column, joint)
            except Question:
                # An open question about the force is asked once the positions are known.
                return None
            factor = unit.factor if quantity is JointQuantity.FORCE else 1.0
            force = factor * bridge(log.columns.values[column])
        if quantity is JointQuantity.FORCE or motor is None:
            return force
        return actuator_constant(log.mechanism, motor) * force
    return None
