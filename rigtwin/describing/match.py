"""Match of a column with a quantity of a joint, and its reasons."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.describing.quantity import JointQuantity

NUMBERED = "numbered in the order of the model's joints"
"""Reason of a match by number."""
REMAINING = "the only column left for the model's joint"
"""Reason of a match by elimination."""
MOTOR_CURRENT = "the current of the joint's motor"
"""Reason of a force that is read from a current."""
ASSUMED = (NUMBERED, REMAINING, MOTOR_CURRENT)
"""Reasons of matches that are assumptions."""
UNNAMED = "its name fits no joint"
"""Reason why a column is not used."""


@dataclass(frozen=True)
class Match:
    """Column that a quantity of a joint can be read from.

    Parameters
    ----------
    column
        Name of the column.
    joint
        Name of the joint.
    quantity
        Quantity that the column holds.
    why
        Reason, for the printed table.
    rank
        Quality of the match; of two columns for one quantity the higher one is taken.
    gear
        Reading per unit of the joint's quantity, of a sensor on the motor's side of a gear.
    """

    column: str
    joint: str
    quantity: JointQuantity
    why: str
    rank: float
    gear: float = 1.0
