"""A log beside a model: its columns, its time, and the columns offered for each joint."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigtwin.describing.clock import Clock
from rigtwin.describing.corrections import Corrections
from rigtwin.describing.formulas import formula_values, read_formula
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.slots import Slots
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.derived import unwrap
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

STATED = "as stated"
"""Reason of a signal whose source the user states (`--column`)."""


def bridge(values: Array) -> Array:
    """Return values with missing cells interpolated; a column without any number as it is.

    The checks differentiate and filter, so that one missing cell would spoil the whole column.

    Parameters
    ----------
    values
        Values of a column, NaN where a cell holds no number, shape (rows,).
    """
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    rows = np.arange(len(values))
    return np.interp(rows, rows[known], values[known])


@dataclass
class Log:
    """Log that is being read.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    stated
        Statements of the user about the log.
    slots
        Columns that are offered for the joints.
    clock
        Time base; None while a question about it is open.
    questions
        Questions that are open.
    notes
        Assumptions that belong to no single signal.
    unused
        Column → why it is not used.
    """

    mechanism: Mechanism
    columns: Columns
    stated: Corrections
    slots: Slots
    clock: Clock | None
    questions: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unused: dict[str, str] = field(default_factory=dict)

    @property
    def time_column(self) -> str:
        """Column of the time; empty without one."""
        return self.clock.column if self.clock is not None else ""

    def time(self) -> Array:
        """Time of the rows, s, shape (rows,)."""
        assert self.clock is not None
        if not self.clock.column:
            return self.clock.period * np.arange(self.columns.rows)
        return unit_of(self.clock.unit)[1] * self.columns.values[self.clock.column]

    def values(self, signal: LogSignal) -> Array:
        """Values of a signal, shape (rows,): in SI, or in the unit of an actuator's control.

        Cells that hold no number are bridged.
        """
        period = self.clock.period if self.clock is not None else 1.0
        if signal.formula:
            formula = read_formula(signal.formula, self.columns.values)
            values = formula_values(formula, self.columns, period, signal.key)
        else:
            try:
                # The unit of an actuator's control may not be in the table of units.
                factor = unit_of(signal.unit)[1]
            except RigtwinError:
                factor = 1.0
            values = self.columns.values[signal.column]
            if signal.wrap is not None:
                values, _ = unwrap(values, signal.wrap)
            values = factor * values
        return signal.sign * signal.scale * bridge(values)

    def stated_signal(self, joint: str, quantity: JointQuantity) -> LogSignal:
        """The signal of a slot whose source the user states."""
        source = self.slots.stated(joint, quantity)
        assert source is not None
        si = SI[JointQuantity.POSITION if quantity is JointQuantity.COMMAND else quantity]
        unit = source.unit or self.stated.units.get(quantity, "")
        assumed = ()
        if not unit and source.column:
            unit = self.columns.units.get(source.column, "")
            if not unit:
                unit = si[self.mechanism.turns(joint)]
                assumed = (f"{unit}, as no unit is given",)
        return LogSignal(
            joint=joint,
            quantity=quantity,
            column=source.column,
            formula=source.formula,
            unit=unit or "1",
            sign=source.sign,
            why=STATED,
            assumed=assumed,
        )
