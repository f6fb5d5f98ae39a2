"""Columns of numbers, as they come out of another program's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.stamps import clock_of, stamps_of
from rigtwin.numerics.arrays import Array

MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "#n/a", "inf", "-inf", "+inf")
"""Cells that hold no value, in small letters."""


@dataclass(frozen=True)
class Columns:
    """values: name → numbers, shape (rows,), not a number where a cell held none; units: name → as
    the file says; form: how it was read, for people; notes: what was odd on the way; wrong: name →
    the first cell that should be a number and is none, and where it stands; words: name of a
    column that is left out, as it holds no numbers → its first cell, and where that stands."""

    values: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    form: str = ""
    notes: tuple[str, ...] = ()
    wrong: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Of the longest column."""
        return max((len(each) for each in self.values.values()), default=0)


def is_missing(cell: str) -> bool:
    """Whether a cell holds no value."""
    return cell.strip().lower() in MISSING


def number_of(cell: str, decimal: str) -> float:
    """A cell as a number. Raises ValueError."""
    if decimal == ",":
        if "." in cell and "," not in cell:
            raise ValueError(cell)
        cell = cell.replace(".", "").replace(",", ".")
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


def is_value(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number, a time, or nothing."""
    if is_missing(cell):
        return True
    try:
        number_of(cell, decimal)
    except ValueError:
        return clock_of(cell) is not None or stamps_of([cell]) is not None
    return True


def numbers_of(cells: Sequence[str], decimal: str) -> tuple[Array, int | None]:
    """A column's cells as numbers; times of day and dates as seconds.

    Parameters
    ----------
    cells
        As they stand in the file.
    decimal
        Its decimal sign.

    Returns
    -------
    array
        Shape (rows,), not a number where a cell holds none.
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
    stamps = stamps_of([cells[row] for row in wrong])
    if stamps is None or np.isfinite(out).any():
        return out, wrong[0]
    out[wrong] = stamps
    return out, None


def join(tables: Mapping[str, Columns]) -> Columns:
    """Files side by side, row by row.

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
        If they have different numbers of rows.
    """
    if len(tables) == 1:
        return next(iter(tables.values()))
    rows = {name: table.rows for name, table in tables.items()}
    if len(set(rows.values())) > 1:
        counts = ", ".join(f"{name} {count}" for name, count in rows.items())
        raise RigtwinError(f"files that are joined must have the same rows; they have: {counts}")
    names = [name for table in tables.values() for name in table.values]
    values: dict[str, Array] = {}
    units: dict[str, str] = {}
    wrong: dict[str, str] = {}
    for file, table in tables.items():
        for name, column in table.values.items():
            for own in (f"{file}.{name}", *([name] if names.count(name) == 1 else [])):
                values[own] = column
                units |= {own: table.units[name]} if name in table.units else {}
                wrong |= {own: table.wrong[name]} if name in table.wrong else {}
    notes = tuple(f"{file}: {note}" for file, table in tables.items() for note in table.notes)
    form = "; ".join(f"{file}: {table.form}" for file, table in tables.items())
    words = {
        f"{file}.{n}": cell for file, table in tables.items() for n, cell in table.words.items()
    }
    words |= {n: cell for table in tables.values() for n, cell in table.words.items()}
    return Columns(values, units, form, notes, wrong, words)
