"""The unit of positions, by velocities that are in the log too.

The rate of a position is its velocity times the ratio of their units. Most ratios belong to one
unit of the position: an angle that grows by 0.105 a second for each rpm is in rad, one that grows
by 6 is in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.describing.log import Log, bridge
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import Question
from rigtwin.describing.units import Unit
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

RATES = {"rad": ("rad/s", "deg/s", "rpm"), "m": ("m/s", "mm/s")}
"""Units of velocities, by the SI unit of the position."""
NEAR = 1.1
"""Largest factor between the ratio of two signals and that of their units."""
CORRELATED = 0.9
"""Least correlation of a position's rate with the velocity."""


def unit_by_velocity(log: Log, columns: Mapping[str, str], units: Sequence[str]) -> Unit | None:
    """Return the unit of positions that fits the velocities of the log.

    Parameters
    ----------
    log
        The log.
    columns
        Joint → column of its position.
    units
        Units that are possible, the SI unit first.

    Returns
    -------
    Unit or None
        None where the log holds no velocity, or where several units fit.
    """
    if log.clock is None:
        return None
    for joint, column in columns.items():
        if not log.slots.has(joint, JointQuantity.VELOCITY):
            continue
        try:
            velocity = log.slots.match(joint, JointQuantity.VELOCITY).column
        except Question:
            # Two columns may be the velocity: neither is evidence.
            continue
        rate = _ratio(log.time(), log.columns.values[column], log.columns.values[velocity])
        fitting = [
            (unit, other)
            for unit in units
            for other in RATES[units[0]]
            if rate is not None
            and abs(math.log(rate * unit_of(unit)[1] / unit_of(other)[1])) < math.log(NEAR)
        ]
        if len(fitting) == 1:
            unit, other = fitting[0]
            return Unit(unit, f"{unit} by {velocity!r}, which is its rate in {other}")
    return None


def _ratio(time: Array, position: Array, velocity: Array) -> float | None:
    """Rate of a position divided by the velocity; None where they do not correlate.

    All arguments have the shape (rows,).
    """
    position, velocity = bridge(position), bridge(velocity)
    steps = np.diff(time)
    moving = steps > 0.0
    rate = np.diff(position)[moving] / steps[moving]
    mean = 0.5 * (velocity[1:] + velocity[:-1])[moving]
    if not np.any(mean) or np.ptp(rate) == 0.0 or np.ptp(mean) == 0.0:
        return None
    if abs(np.corrcoef(rate, mean)[0, 1]) < CORRELATED:
        return None
    return abs(float(rate @ mean / (mean @ mean)))
