"""Columns of numbers, as read from another program's file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.stamps import clock_of, stamps_of
from rigtwin.numerics.arrays import Array

MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "#n/a", "inf", "-inf", "+inf")
"""Cells that hold no value, in lower case."""
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d*([eE][+-]?\d+)?")
"""Number with a decimal comma and dots between thousands."""


@dataclass(frozen=True)
class Columns:
    """Table of numbers.

    Parameters
    ----------
    values
        Name → numbers, shape (rows,); NaN where a cell holds no number.
    units
        Name → unit as the file spells it.
    form
        Description of the file's format, for messages.
    notes
        Irregularities of the file, one line per irregularity.
    wrong
        Name → first cell that is neither a number nor missing, and its place.
    listed
        All columns of numbers in the file, including those that were not read.
    refused
        Name → why the column cannot be read as numbers.
    episode
        Column with the number of the episode; "" if the file holds a single one.
    remarks
        Lines of text above the data that are neither names nor units.
    """

    values: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    form: str = ""
    notes: tuple[str, ...] = ()
    wrong: Mapping[str, str] = field(default_factory=dict)
    listed: tuple[str, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)
    episode: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows of the longest column."""
        return max((len(each) for each in self.values.values()), default=0)

    @property
    def names(self) -> tuple[str, ...]:
        """All columns of numbers, including those that were not read."""
        return tuple(dict.fromkeys((*self.listed, *self.values)))


def is_missing(cell: str) -> bool:
    """Return whether a cell holds no value."""
    return cell.strip().lower() in MISSING


def number_of(cell: str, decimal: str) -> float:
    """Return the number in a cell. Raises ValueError for any other cell."""
    # With a decimal comma, dots separate thousands. "1.234" is then ambiguous, and "1,234.5" has a
    # decimal point: both are refused.
    if decimal == ",":
        if "." in cell and not _THOUSANDS.fullmatch(cell.strip()):
            raise ValueError(cell)
        cell = cell.replace(".", "").replace(",", ".")
    # float() accepts Python's "1_000", which no measuring program writes as a number.
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell holds a number, a date, a time of day, or nothing."""
    if is_missing(cell):
        return True
    try:
        number_of(cell, decimal)
    except ValueError:
        return clock_of(cell) is not None or stamps_of([cell]) is not None
    return True


def numbers_of(cells: Sequence[str], decimal: str) -> tuple[Array, int | None]:
    """Return a column's cells as numbers; times of day and dates as seconds.

    Parameters
    ----------
    cells
        Texts of the cells.
    decimal
        Decimal sign of the file.

    Returns
    -------
    array
        Numbers, shape (rows,); NaN where a cell holds no number.
    int or None
        The first row whose cell is neither a number nor missing.
    """
    if decimal == "." and not any("_" in cell for cell in cells):
        try:
            plain = np.array(cells, float)
        except ValueError:
            pass
        else:
            plain[np.isinf(plain)] = np.nan
            return plain, None
    out = np.full(len(cells), np.nan)
    wrong: list[int] = []
    for row, cell in enumerate(cells):
        try:
            out[row] = number_of(cell, decimal)
        except ValueError:
            if not is_missing(cell):
                wrong.append(row)
    out[np.isinf(out)] = np.nan
    if not wrong:
        return out, None
    # Dates among numbers are errors: a column of stamps has stamps in all of its cells.
    stamps = stamps_of([cells[row] for row in wrong])
    if stamps is None or np.isfinite(out).any():
        return out, wrong[0]
    out[wrong] = stamps
    return out, None


def join(tables: Mapping[str, Columns]) -> Columns:
    """Return the columns of several files, joined row by row.

    Parameters
    ----------
    tables
        A file's name without its ending → its columns.

    Returns
    -------
    Columns
        Every column as `FILE.NAME`, and as `NAME` where only one file has it.

    Raises
    ------
    RigtwinError
        If the files have different numbers of rows, or one of them holds episodes.
    """
    if len(tables) == 1:
        return next(iter(tables.values()))
    rows = {name: table.rows for name, table in tables.items()}
    if len(set(rows.values())) > 1:
        counts = ", ".join(f"{name} {count}" for name, count in rows.items())
        raise RigtwinError(f"joined files must have equal numbers of rows; they have: {counts}")
    for file, table in tables.items():
        if table.episode:
            raise RigtwinError(
                f"{file} holds episodes and cannot be put beside another file; import it alone"
            )
    names = [name for table in tables.values() for name in table.names]
    values: dict[str, Array] = {}
    units: dict[str, str] = {}
    wrong: dict[str, str] = {}
    refused: dict[str, str] = {}
    listed: list[str] = []
    for file, table in tables.items():
        for name, column in table.values.items():
            # A column is known by its bare name too, if only one of the files has it.
            for label in (f"{file}.{name}", *([name] if names.count(name) == 1 else [])):
                values[label] = column
                units |= {label: table.units[name]} if name in table.units else {}
                wrong |= {label: table.wrong[name]} if name in table.wrong else {}
        for name in table.names:
            listed += [f"{file}.{name}", *([name] if names.count(name) == 1 else [])]
        for name, reason in table.refused.items():
            refused |= {f"{file}.{name}": reason, name: reason}
    notes = tuple(f"{file}: {note}" for file, table in tables.items() for note in table.notes)
    form = "; ".join(f"{file}: {table.form}" for file, table in tables.items())
    return Columns(values, units, form, notes, wrong, tuple(listed), refused)
