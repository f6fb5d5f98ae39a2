"""A quantity of a joint as it is read from a log."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.describing.quantity import JointQuantity

MEASUREMENTS = (JointQuantity.POSITION, JointQuantity.VELOCITY, JointQuantity.FORCE)
"""Quantities that a sensor measures."""


@dataclass(frozen=True)
class LogSignal:
    """Source of a quantity of a joint, and what was assumed about it.

    Parameters
    ----------
    joint
        Name of the joint.
    quantity
        Quantity that is read.
    column
        Column of the log; empty where a formula gives the values.
    unit
        Unit of the column.
    why
        Reason for the column.
    formula
        Formula of columns, in SI; empty where a column gives the values.
    sign
        1 or -1.
    assumed
        Assumptions about unit, sign and scale, one a sentence; empty where the log or its owner
        states everything.
    scale
        Factor after conversion to SI, such as that of an actuator's gear.
    checked
        Result of a check against the model; empty without one.
    wrap
        Range within which an angle begins again, in the column's unit; None of a continuous signal.
    from_command
        Whether the signal is the force that a command stands for.
    """

    joint: str
    quantity: JointQuantity
    column: str
    unit: str
    why: str
    formula: str = ""
    sign: float = 1.0
    assumed: tuple[str, ...] = ()
    scale: float = 1.0
    checked: str = ""
    wrap: float | None = None
    from_command: bool = False

    @property
    def key(self) -> str:
        """Name by which the signal can be corrected, such as elbow.position."""
        return f"{self.joint}.{'command' if self.commands else self.quantity.value}"

    @property
    def commands(self) -> bool:
        """Whether the quantity is a command of the joint's actuator."""
        return self.quantity not in MEASUREMENTS

    @property
    def source(self) -> str:
        """Column or formula with its sign, for messages."""
        return f"{'-' if self.sign < 0.0 else ''}{self.column or self.formula}"
