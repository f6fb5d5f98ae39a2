"""Columns that number the positions of all joints and then their velocities, or in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.describing.match import Match
from rigtwin.describing.quantity import JointQuantity
from rigtwin.numerics.arrays import Array

RATE = 0.7
"""Least correlation of a column with the rate of another one of which it is the velocity. Noise of
the position weakens it."""


def split_state(
    family: Sequence[str], values: Mapping[str, Array], joints: Sequence[str]
) -> list[Match]:
    """Match a numbered state with the positions and velocities of the joints.

    Parameters
    ----------
    family
        Numbered columns, in the order of their numbers.
    values
        Column → numbers, shape (rows,).
    joints
        Joints of the model, in its order.

    Returns
    -------
    list of Match
        Positions and velocities, joint by joint. It is empty unless the columns are twice as many
        as the joints, and every second one is the rate of another.
    """
    count = len(joints)
    if not count or len(family) != 2 * count:
        return []
    stacked = [(family[n], family[n + count]) for n in range(count)]
    in_turn = [(family[2 * n], family[2 * n + 1]) for n in range(count)]
    for pairs, why in (
        (stacked, "positions of all joints, then their rates"),
        (in_turn, "the position of each joint, then its rate"),
    ):
        if all(_is_rate(values[first], values[second]) for first, second in pairs):
            quantities = JointQuantity.POSITION, JointQuantity.VELOCITY
            return [
                Match(column, joint, quantity, f"the state holds {why}", 1.0)
                for joint, pair in zip(joints, pairs, strict=True)
                for column, quantity in zip(pair, quantities, strict=True)
            ]
    return []


def _is_rate(position: Array, velocity: Array) -> bool:
    """Return whether a column is the rate of another one; both have the shape (rows,)."""
    # Central differences over a few rows: a single one would be mostly noise.
    known = np.isfinite(position) & np.isfinite(velocity)
    first, second = position[known], velocity[known]
    if len(first) < 20 or np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return False
    width = 4
    rate, measured = first[2 * width :] - first[: -2 * width], second[width:-width]
    return bool(np.corrcoef(rate, measured)[0, 1] >= RATE)
