"""Formulas of columns as the owner of a log states them, with any column's name in them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from controllers.formula import formula
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.derived import evaluate
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class ColumnFormula:
    """Formula that a map can hold.

    Parameters
    ----------
    text
        Formula with a plain name for every column.
    names
        Plain name → column.
    constant
        Value of a formula that is a number; None of any other.
    """

    text: str
    names: Mapping[str, str]
    constant: float | None = None


def read_formula(text: str, columns: Iterable[str]) -> ColumnFormula:
    """Return a formula with a plain name for every column in it.

    Parameters
    ----------
    text
        Formula that names columns as the log does, such as `pos.Joint_1 / 32`.
    columns
        All columns of the log.
    """
    try:
        return ColumnFormula(text, {}, float(text))
    except ValueError:
        pass
    names: dict[str, str] = {}
    # The longest names first, or q1 would be replaced within q12.
    for column in sorted(columns, key=len, reverse=True):
        # Formulas of maps know plain names only.
        plain = re.sub(r"[^A-Za-z0-9]+", "_", column).strip("_") or "column"
        plain = plain if re.match(r"[A-Za-z]", plain) else f"c_{plain}"
        # Different columns may have the same plain name, as a.b and a_b do.
        while names.get(plain, column) != column:
            plain += "_"
        # Whole names only; a dot before or after would make it part of another column's name.
        replaced = re.sub(rf"(?<![\w.]){re.escape(column)}(?![\w.])", plain, text)
        if replaced != text or (plain == column and re.search(rf"\b{plain}\b", text)):
            names[plain] = column
            text = replaced
    return ColumnFormula(text, names)


def formula_values(stated: ColumnFormula, columns: Columns, period: float, where: str) -> Array:
    """Return the values of a formula, shape (rows,).

    Parameters
    ----------
    stated
        The formula.
    columns
        Columns of the log.
    period
        Period of the rows, s.
    where
        Name of the quantity, for an error.
    """
    if stated.constant is not None:
        return np.full(columns.rows, stated.constant)
    try:
        compiled = formula(stated.text, {})
    except ValueError as error:
        raise RigtwinError(f"--column {where}={stated.text}: {error}") from None
    missing = [name for name in compiled.inputs if name not in stated.names]
    if missing:
        raise RigtwinError(
            f"--column {where}={stated.text}: no column {missing[0]!r}; "
            f"there are {', '.join(columns.values)}"
        )
    values = {}
    for name in compiled.inputs:
        column = stated.names[name]
        unit = columns.units.get(column, "1")
        factor = unit_of(unit)[1] if is_unit(unit) else 1.0
        values[name] = factor * columns.values[column]
    return evaluate(compiled, values, period)
