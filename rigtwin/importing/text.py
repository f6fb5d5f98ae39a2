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
from rigtwin.importing.lines import find_encoding, is_cut_off, read_lines
from rigtwin.importing.naming import repeated_names, split_unit
from rigtwin.importing.selection import EVERYTHING, Selection
from rigtwin.importing.units import is_unit

SEPARATORS = (";", "\t", ",", "|", " ")
"""Separators, in the order in which they are preferred where several fit."""
SURE = 5
"""Number of consecutive lines of one shape that mark the beginning of the data."""
HEADER = 400
"""Number of lines within which the data must begin."""
MOST_COLUMNS = 20_000
"""Largest number of columns of a file."""
UNITS = 0.6
"""Share of the texts in a line below the names that must be units for it to be a line of units."""
NUMBERED = 3
"""Number of columns from which a first line 0, 1, 2, … is a header that numbers them."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text file.

    Parameters
    ----------
    separator, decimal
        Separator of the cells, and the decimal sign.
    first
        Index of the line at which the data begin.
    names, units
        Names and units of the columns.
    words
        Places of the columns that hold words.
    remarks
        Lines above the names of the columns.
    """

    separator: str
    decimal: str
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    words: frozenset[int] = frozenset()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Line:
    """Shape of one line.

    Parameters
    ----------
    cells
        Number of cells.
    words
        Places of the cells that are no values.
    numbers
        Number of cells that are numbers.
    """

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
    head, layout = _read_head(path, encoding)
    refused = repeated_names(layout.names)
    known = {
        name: place
        for place, name in enumerate(layout.names)
        if place not in layout.words and name not in refused
    }
    needed = {name: place for name, place in known.items() if selection.takes(name)}
    columns, notes, lines = _read_columns(path, encoding, head, layout, list(needed.values()))
    values = {name: columns[place].values for name, place in needed.items()}
    wrong = {
        name: f"{cell[:40]!r} in line {lines[row]}"
        for name, place in needed.items()
        for row, cell in filter(None, [columns[place].wrong])
    }
    units = {n: u for n, u in zip(layout.names, layout.units, strict=True) if u and n in values}
    for name, place in needed.items():
        if columns[place].are_stamps:
            units.setdefault(name, "s")
    if not any(note.startswith("the last line") for note in notes) and is_cut_off(path, encoding):
        notes = (
            *notes,
            "the last line has no end; if the file was cut off there, its last number may be wrong",
        )
    if layout.words:
        refused |= _refuse_words(layout, head[layout.first])
    return Columns(
        values,
        units,
        _describe_form(layout),
        notes,
        wrong,
        listed=tuple(known),
        refused=refused,
        remarks=layout.remarks,
    )


def _read_head(path: Path, encoding: str) -> tuple[list[str], Layout]:
    """Return the first lines of a file, and its layout."""
    head = list(islice(read_lines(path, encoding), HEADER))
    # Blank lines at the end would count as lines of another shape in a short file.
    while head and not head[-1].strip():
        head.pop()
    try:
        layout = find_layout(head)
    except RigtwinError as error:
        raise RigtwinError(f"{path}: {error}") from None
    if layout is None:
        raise RigtwinError(f"{path}: no lines of numbers in its first {HEADER} lines")
    return head, layout


def _describe_form(layout: Layout) -> str:
    """Return a description of a file's layout, for messages."""
    mark = {"\t": "tab", " ": "space"}.get(layout.separator, layout.separator)
    form = f"text, separated by {mark}, decimal {layout.decimal}, data from line {layout.first + 1}"
    if not layout.words:
        return form
    return f"{form}; words in {', '.join(layout.names[place] for place in sorted(layout.words))}"


def _refuse_words(layout: Layout, line: str) -> dict[str, str]:
    """Return the columns that hold words in the first line of data, and why they are refused."""
    cells = split_cells(line, layout.separator)
    return {
        layout.names[place]: f"it holds {cells[place][:40]!r} in line {layout.first + 1}, which "
        "was taken for a word; expected plain numbers, such as 1234.5, without thousands "
        "separators, and not hexadecimal"
        for place in layout.words
    }


def _read_columns(
    path: Path, encoding: str, head: Sequence[str], layout: Layout, places: Sequence[int]
) -> tuple[Mapping[int, Numbers], tuple[str, ...], Sequence[int]]:
    """Return the numbers in these places, what was odd, and the number of each row's line."""
    arguments = (layout.separator, layout.decimal, len(layout.names), places)
    fast = read_plain(path, encoding, head[: layout.first], *arguments)
    if fast is not None:
        return {place: Numbers(values) for place, values in fast.items()}, (), ()
    lines = islice(enumerate(read_lines(path, encoding), start=1), layout.first, None)
    rows = gather_rows(path, lines, *arguments)
    columns = {place: builder.finish() for place, builder in rows.columns.items()}
    return columns, tuple(rows.notes), rows.numbers


def _look_at(line: str, separator: str, decimal: str) -> Line:
    cells = split_cells(line, separator)
    if len(cells) > MOST_COLUMNS:
        raise RigtwinError(
            f"a line that begins {line[:30]!r} has {len(cells)} cells; "
            f"expected at most {MOST_COLUMNS}"
        )
    while cells and not cells[-1]:
        cells.pop()
    words = frozenset(n for n, cell in enumerate(cells) if not is_value(cell, decimal))
    missing = sum(is_missing(cell) for cell in cells)
    return Line(len(cells), words, len(cells) - len(words) - missing)


def find_layout(lines: Sequence[str]) -> Layout | None:
    """Return the layout of a text; None if it has no lines of numbers."""
    best: tuple[tuple[int, int], Layout] | None = None
    # Some programs leave a blank line after each row.
    kept = [number for number, line in enumerate(lines[:HEADER]) if line.strip()]
    rows = [lines[number] for number in kept]
    for separator in SEPARATORS:
        for decimal in (".", ","):
            if decimal == separator:
                continue
            # Every combination is tried on the head: a decimal comma is only told from a
            # separating one by which reading gives the more columns of numbers.
            seen = [_look_at(line, separator, decimal) for line in rows]
            first = next((n for n in range(len(seen)) if _begins(seen, n)), None)
            if first is None:
                continue
            above = rows[first - 1] if first else ""
            is_named = _names_columns(above, seen[first].cells, separator)
            # The more columns of numbers the better; commas that are decimals would else part them.
            numbers = seen[first].cells - 2 * len(seen[first].words)
            quality = (numbers, -SEPARATORS.index(separator))
            if (
                separator == ","
                and all("." not in line for line in rows[first : first + SURE])
                and not is_named
                # Numbers such as 1,5;2,5 split at commas give twice the columns; half of them is
                # what another separator has to beat.
                and numbers % 2 == 0
            ):
                quality = (numbers // 2, -SEPARATORS.index(separator))
            if best is None or quality > best[0]:
                # Below names, a row 0, 1, 2 is data.
                is_numbering = not is_named and _is_numbering(rows[first : first + 2], separator)
                begin = kept[first + is_numbering]
                plain = Layout(separator, decimal, begin, (), (), seen[first].words)
                best = quality, _read_header(lines, plain, seen[first].cells)
    return None if best is None else best[1]


def _names_columns(line: str, columns: int, separator: str) -> bool:
    """Return whether a line has as many names as there are columns."""
    cells = split_cells(line, separator)
    return len(cells) == columns and all(any(map(str.isalpha, cell)) for cell in cells)


def _is_numbering(lines: Sequence[str], separator: str) -> bool:
    """Return whether the first of two lines numbers the columns from 0 or 1, as pandas does where
    they have no names. The next line then holds something else than whole numbers."""
    if len(lines) < 2:
        return False
    numbers = [cell for cell in split_cells(lines[0], separator) if cell]
    below = [cell for cell in split_cells(lines[1], separator) if cell]
    counts = [[str(n + start) for n in range(len(numbers))] for start in (0, 1)]
    return len(numbers) >= NUMBERED and numbers in counts and not all(map(str.isdigit, below))


def _begins(seen: Sequence[Line], at: int) -> bool:
    """Return whether the data begin at a line: the next lines have its number of cells, and words
    in the same places."""
    block, start = seen[at : at + SURE], seen[at]
    return (
        start.numbers > 0
        and len(start.words) < start.cells
        and all((each.cells, each.words) == (start.cells, start.words) for each in block)
        # A file shorter than SURE lines may end within the block.
        and (len(block) == SURE or at + len(block) == len(seen))
    )


def _read_header(lines: Sequence[str], layout: Layout, columns: int) -> Layout:
    """Return the layout with names and units from the lines above the data."""
    above = []
    for line in reversed(lines[: layout.first]):
        cells = split_cells(line.lstrip("#%"), layout.separator)
        while len(cells) > columns and not cells[-1]:
            cells.pop()
        if len(cells) == columns and any(cells):
            above.append(cells)
        elif above or line.strip():
            break
    names, units = [f"column{n + 1}" for n in range(columns)], [""] * columns
    if above:
        stated = _read_units(above[0], above[1] if len(above) > 1 else ())
        names, units = (above[1], stated) if stated else (above[0], units)
    pairs = [split_unit(name, unit) for name, unit in zip(names, units, strict=True)]
    return replace(
        layout,
        names=tuple(n for n, _ in pairs),
        units=tuple(u for _, u in pairs),
        remarks=tuple(line.strip() for line in lines[: layout.first - len(above)]),
    )


def _read_units(cells: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return the units that the line below the names states; none where that is another line.

    Some cells may be empty, or hold a unit that has no place here, such as that of a temperature.
    """
    texts = [cell.strip().strip("[]()").strip() for cell in cells]
    known = sum(is_unit(text) for text in texts)
    named = len(set(names)) == len(names) > 0 and all(names) and not all(map(is_unit, names))
    return texts if named and known >= UNITS * sum(map(bool, texts)) > 0.0 else []


ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log")
FORMAT = Format("text", (*ENDINGS, *(f"{ending}.gz" for ending in ENDINGS)), read_text)
