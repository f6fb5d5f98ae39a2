"""Cells of a text file as columns of numbers, block by block, in bounded memory."""

from __future__ import annotations

import csv
import io
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import is_missing, is_value, number_of, numbers_of
from rigtwin.numerics.arrays import Array

BLOCK = 20_000
"""Rows whose cells are kept as text at a time."""


@dataclass(frozen=True)
class Numbers:
    """Numbers of one column.

    Parameters
    ----------
    values
        Numbers, shape (rows,); NaN where a cell holds no number.
    wrong
        First row whose cell is neither a number nor missing, and the cell; None without one.
    are_stamps
        Whether the cells are dates or times of day, in s.
    """

    values: Array
    wrong: tuple[int, str] | None = None
    are_stamps: bool = False


@dataclass
class ColumnBuilder:
    """Numbers of one column, gathered block by block.

    Cells stay text only in a block that holds something other than plain numbers: decimal commas,
    dates, words.

    Parameters
    ----------
    decimal
        Decimal sign of the file.
    cells
        Cells of the block that is being gathered.
    """

    decimal: str
    cells: list[str] = field(default_factory=list)
    _blocks: list[Array | list[str]] = field(default_factory=list)

    def end_block(self) -> None:
        """Turn the gathered cells into numbers, if they are plain numbers."""
        block: Array | list[str] = self.cells
        # NumPy reads "1_000" as 1000, as Python does; a logger does not mean that.
        if self.decimal == "." and not any("_" in cell for cell in self.cells):
            try:
                block = np.array(self.cells, float)
            except ValueError:
                pass
            else:
                block[np.isinf(block)] = np.nan
        self._blocks.append(block)
        self.cells = []

    def finish(self) -> Numbers:
        """Return the numbers of all blocks."""
        self.end_block()
        plain = [block for block in self._blocks if isinstance(block, np.ndarray)]
        blocks, self._blocks = self._blocks, []
        if len(plain) == len(blocks):
            return Numbers(np.concatenate(plain))
        cells: list[str] = []
        for block in blocks:
            # repr gives the shortest text that reads back as the same double.
            cells += block if isinstance(block, list) else map(repr, block.tolist())
        values, row = numbers_of(cells, self.decimal)
        if row is not None:
            return Numbers(values, (row, cells[row]))
        return Numbers(values, None, self._are_stamps(cells))

    def _are_stamps(self, cells: Sequence[str]) -> bool:
        cell = next((cell for cell in cells if not is_missing(cell)), "0")
        try:
            number_of(cell, self.decimal)
        except ValueError:
            return True
        return False


@dataclass
class Rows:
    """Rows of a text file.

    Parameters
    ----------
    columns
        Place of a needed column → its numbers.
    numbers
        Number of each row's line.
    notes
        Irregularities of the rows, one line per irregularity.
    """

    columns: dict[int, ColumnBuilder]
    numbers: array[int] = field(default_factory=lambda: array("q"))
    notes: list[str] = field(default_factory=list)

    def add(self, number: int, cells: Sequence[str]) -> None:
        """Add the row of a line."""
        self.numbers.append(number)
        for place, builder in self.columns.items():
            # Missing cells become empty ones, which are read as NaN, so that all columns keep one
            # length.
            builder.cells.append(cells[place].strip() if place < len(cells) else "")
        if len(self.numbers) % BLOCK == 0:
            for builder in self.columns.values():
                builder.end_block()


def gather_rows(
    path: Path,
    lines: Iterable[tuple[int, str]],
    separator: str,
    decimal: str,
    wide: int,
    places: Sequence[int],
) -> Rows:
    """Gather the needed cells of rows.

    A row that breaks off lacks its last cells; the last row of a file is left out then.

    Parameters
    ----------
    path
        File, for messages.
    lines
        Numbers and texts of the lines that hold the rows.
    separator, decimal
        Separator of the cells, and the decimal sign.
    wide
        Number of columns.
    places
        Places of the needed columns.

    Returns
    -------
    Rows
        The needed columns.

    Raises
    ------
    RigtwinError
        If a row has numbers beyond its last column.
    """
    rows = Rows({place: ColumnBuilder(decimal) for place in places})
    short: list[int] = []
    long: list[int] = []
    # A row is added when the next one comes, as the last one may break off.
    waiting: tuple[int, list[str]] | None = None
    for number, cells in _split_rows(lines, separator, wide):
        if len(cells) > wide:
            # A number too many shifts all columns; a remark behind the last column harms nothing.
            if any(is_value(cell.strip(), decimal) for cell in cells[wide:]):
                raise RigtwinError(f"{path}: line {number} has {len(cells)} cells; expected {wide}")
            long.append(number)
        elif len(cells) < wide:
            short.append(number)
        if waiting is not None:
            rows.add(*waiting)
        waiting = number, cells
    if waiting is not None:
        if short and short[-1] == waiting[0]:
            rows.notes.append(f"the last line, {short.pop()}, breaks off and is left out")
        else:
            rows.add(*waiting)
    rows.notes += _note_lengths(short, long)
    return rows


def _note_lengths(short: Sequence[int], long: Sequence[int]) -> Iterator[str]:
    """Yield remarks on the lines with too few and too many cells."""
    if short:
        yield f"{len(short)} lines break off, the first is {short[0]}; cells are missing"
    if long:
        yield f"{len(long)} lines have words after their last cell, the first is {long[0]}"


def _split_rows(
    lines: Iterable[tuple[int, str]], separator: str, wide: int
) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is not blank."""
    blank = separator + " \t"
    for number, line in lines:
        cells = raw_cells(line, separator)
        if not line.strip(blank) or not any(map(str.strip, cells)):
            continue
        # Many programs end each line with a separator, which makes an empty last cell.
        while len(cells) > wide and not cells[-1].strip():
            cells.pop()
        yield number, cells


def raw_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, blanks about them included."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return line.split(separator) if line else []
    # The csv module is much slower than split, and only quotes need it.
    try:
        return next(csv.reader(io.StringIO(line), delimiter=separator), [])
    except csv.Error as error:
        raise RigtwinError(f"a line that begins {line[:30]!r}: {error}") from None


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line."""
    return [cell.strip() for cell in raw_cells(line, separator)]
