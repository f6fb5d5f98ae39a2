"""Text files of numbers, however they are written: separators, decimal commas, lines above the
data, columns of words, rows that break off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.importing.cells import Numbers, gather_rows, split_cells
from rigtwin.importing.columns import Columns, is_missing, is_value
from rigtwin.importing.fast_text import read_plain
from rigtwin.importing.format import Format
from rigtwin.importing.lines import find_encoding, read_lines
from rigtwin.importing.naming import repeated_names, split_unit
from rigtwin.importing.selection import EVERYTHING, Selection
from rigtwin.importing.units import is_unit

SEPARATORS = (";", "\t", ",", "|", " ")
"""In the order in which they are preferred where several would do."""
SURE = 5
"""Lines of as many cells each, words in the same ones, that are the beginning of the data."""
HEADER = 400
"""Lines within which the data must begin."""


@dataclass(frozen=True)
class Layout:
    """How a text file is written. first: line at which the data begin; words: places of the columns
    that hold words."""

    separator: str
    decimal: str
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    words: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Line:
    """cells: how many; words: places of those that are no values; numbers: how many are numbers."""

    cells: int
    words: frozenset[int]
    numbers: int


def read_text(path: Path, selection: Selection = EVERYTHING) -> Columns:
    """Read the needed columns of a text file, block by block.

    Parameters
    ----------
    path
        The file, plain or compressed by gzip.
    selection
        Columns that are needed. Defaults to all.

    Returns
    -------
    Columns
        The needed columns.

    Raises
    ------
    RigtwinError
        Saying what is wrong, and in which line.
    """
    encoding = find_encoding(path)
    head = list(islice(read_lines(path, encoding), HEADER))
    while head and not head[-1].strip():
        head.pop()
    try:
        found = find_layout(head)
    except RigtwinError as error:
        raise RigtwinError(f"{path}: {error}") from None
    if found is None:
        raise RigtwinError(f"{path}: no lines of numbers in its first {HEADER} lines")
    refused = repeated_names(found.names)
    known = {
        name: place
        for place, name in enumerate(found.names)
        if place not in found.words and name not in refused
    }
    needed = {name: place for name, place in known.items() if selection.takes(name)}
    columns, notes, lines = _read_columns(path, encoding, head, found, list(needed.values()))
    values = {name: columns[place].values for name, place in needed.items()}
    wrong = {
        name: f"{cell[:40]!r} in line {lines[row]}"
        for name, place in needed.items()
        for row, cell in filter(None, [columns[place].wrong])
    }
    units = {n: u for n, u in zip(found.names, found.units, strict=True) if u and n in values}
    for name, place in needed.items():
        if columns[place].are_stamps:
            units.setdefault(name, "s")
    mark = {"\t": "tab", " ": "space"}.get(found.separator, found.separator)
    form = f"text, separated by {mark}, decimal {found.decimal}, data from line {found.first + 1}"
    if found.words:
        form += f"; words in {', '.join(found.names[place] for place in sorted(found.words))}"
        first = split_cells(head[found.first], found.separator)
        refused |= {
            found.names[place]: f"it holds {first[place][:40]!r} in line {found.first + 1}, which "
            "was taken for a word; expected plain numbers, such as 1234.5, without thousands "
            "separators, and not hexadecimal"
            for place in found.words
        }
    return Columns(values, units, form, notes, wrong, listed=tuple(known), refused=refused)


def _read_columns(
    path: Path, encoding: str, head: Sequence[str], found: Layout, places: Sequence[int]
) -> tuple[Mapping[int, Numbers], tuple[str, ...], Sequence[int]]:
    """Return the numbers in these places, what was odd, and the number of each row's line."""
    layout = (found.separator, found.decimal, len(found.names), places)
    fast = read_plain(path, encoding, head[: found.first], *layout)
    if fast is not None:
        return {place: Numbers(values) for place, values in fast.items()}, (), ()
    lines = islice(enumerate(read_lines(path, encoding), start=1), found.first, None)
    rows = gather_rows(path, lines, *layout)
    columns = {place: builder.finish() for place, builder in rows.columns.items()}
    return columns, tuple(rows.notes), rows.numbers


def _look_at(line: str, separator: str, decimal: str) -> Line:
    cells = split_cells(line, separator)
    while cells and not cells[-1]:
        cells.pop()
    words = frozenset(n for n, cell in enumerate(cells) if not is_value(cell, decimal))
    missing = sum(is_missing(cell) for cell in cells)
    return Line(len(cells), words, len(cells) - len(words) - missing)


def find_layout(lines: Sequence[str]) -> Layout | None:
    """How a text is written; None if no lines of numbers are in it."""
    best: tuple[tuple[int, int], Layout] | None = None
    for separator in SEPARATORS:
        for decimal in (".", ","):
            if decimal == separator:
                continue
            seen = [_look_at(line, separator, decimal) for line in lines[:HEADER]]
            first = next((n for n in range(len(seen)) if _begins(seen, n)), None)
            if first is None:
                continue
            # The more columns of numbers the better; commas that are decimals would else part them.
            numbers = seen[first].cells - 2 * len(seen[first].words)
            quality = (numbers, -SEPARATORS.index(separator))
            if (
                separator == ","
                and all("." not in line for line in lines[first : first + SURE])
                and numbers % 2 == 0
            ):
                quality = (numbers // 2, -SEPARATORS.index(separator))
            if best is None or quality > best[0]:
                plain = Layout(separator, decimal, first, (), (), seen[first].words)
                best = quality, _read_header(lines, plain, seen[first].cells)
    return None if best is None else best[1]


def _begins(seen: Sequence[Line], at: int) -> bool:
    """Whether the data begin here: as many cells in each of some lines, words in the same ones."""
    block, here = seen[at : at + SURE], seen[at]
    return (
        here.numbers > 0
        and len(here.words) < here.cells
        and all((each.cells, each.words) == (here.cells, here.words) for each in block)
        and (len(block) == SURE or at + len(block) == len(seen))
    )


def _read_header(lines: Sequence[str], found: Layout, columns: int) -> Layout:
    """The layout with names and units from the lines above the data."""
    above = []
    for line in reversed(lines[: found.first]):
        cells = split_cells(line.lstrip("#%"), found.separator)
        while len(cells) > columns and not cells[-1]:
            cells.pop()
        if len(cells) == columns and any(cells):
            above.append(cells)
        elif above or line.strip():
            break
    names, units = [f"column{n + 1}" for n in range(columns)], [""] * columns
    if above:
        nearest = above[0]
        marked = all(is_unit(cell) for cell in nearest)
        if marked and len(above) > 1:
            names, units = above[1], nearest
        else:
            names = nearest
    pairs = [split_unit(name, unit) for name, unit in zip(names, units, strict=True)]
    return replace(found, names=tuple(n for n, _ in pairs), units=tuple(u for _, u in pairs))


ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log")
FORMAT = Format("text", (*ENDINGS, *(f"{ending}.gz" for ending in ENDINGS)), read_text)
