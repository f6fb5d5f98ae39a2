"""Text files of numbers, however they are written: separators, decimal commas, lines above the
data, columns of words, rows that break off."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns, is_missing, is_value, number_of, numbers_of
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


def read_text(path: Path) -> Columns:
    """Columns of a text file. Raises RigtwinError saying what is wrong and in which line."""
    lines = _decode(path).splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    try:
        found = find_layout(lines)
    except RigtwinError as error:
        raise RigtwinError(f"{path}: {error}") from None
    if found is None:
        raise RigtwinError(f"{path}: no lines of numbers in its first {HEADER} lines")
    for name, count in Counter(found.names).items():
        if count > 1:
            raise RigtwinError(f"{path}: {count} columns are named {name!r}")
    numbers, rows, notes = _rows(path, lines, found)
    values, wrong = {}, {}
    for place, name in enumerate(found.names):
        if place in found.words:
            continue
        values[name], bad = numbers_of([row[place] for row in rows], found.decimal)
        if bad is not None:
            wrong[name] = f"{rows[bad][place][:40]!r} in line {numbers[bad]}"
    mark = {"\t": "tab", " ": "space"}.get(found.separator, found.separator)
    form = f"text, separated by {mark}, decimal {found.decimal}, data from line {found.first + 1}"
    if found.words:
        form += f"; words in {', '.join(found.names[place] for place in sorted(found.words))}"
    units = {n: u for n, u in zip(found.names, found.units, strict=True) if u and n in values}
    for place, name in enumerate(found.names):
        if name in values and name not in units and _holds_stamps(rows, place, found.decimal):
            units[name] = "s"
    words = {
        found.names[place]: f"{rows[0][place][:40]!r} in line {numbers[0]}"
        for place in sorted(found.words)
        if rows
    }
    return Columns(values, units, form, notes, wrong, words)


def _holds_stamps(rows: Sequence[Sequence[str]], place: int, decimal: str) -> bool:
    """Whether a column's first cell is a date or a time of day, which are in seconds."""
    cell = next((row[place] for row in rows if not is_missing(row[place])), "")
    try:
        number_of(cell, decimal)
    except ValueError:
        return bool(cell)
    return False


def _rows(
    path: Path, lines: Sequence[str], found: Layout
) -> tuple[list[int], list[list[str]], tuple[str, ...]]:
    """Line numbers, cells, and what was odd. A row that breaks off lacks its last cells; of the
    last row nothing is believed then."""
    wide = len(found.names)
    numbers: list[int] = []
    rows: list[list[str]] = []
    short: list[int] = []
    long: list[int] = []
    for number, line in enumerate(lines[found.first :], start=found.first + 1):
        cells = _cells(line, found.separator)
        if not any(cells):
            continue
        while len(cells) > wide and not cells[-1]:
            cells.pop()
        if len(cells) > wide:
            if any(is_value(cell, found.decimal) for cell in cells[wide:]):
                raise RigtwinError(f"{path}: line {number} has {len(cells)} cells; expected {wide}")
            long.append(number)
        elif len(cells) < wide:
            short.append(number)
        numbers.append(number)
        rows.append((cells + [""] * wide)[:wide])
    notes = []
    if short and short[-1] == numbers[-1]:
        notes.append(f"the last line, {short.pop()}, breaks off and is left out")
        numbers.pop()
        rows.pop()
    if short:
        notes.append(f"{len(short)} lines break off, the first is {short[0]}; cells are missing")
    if long:
        notes.append(f"{len(long)} lines have words after their last cell, the first is {long[0]}")
    return numbers, rows, tuple(notes)


def _decode(path: Path) -> str:
    raw = path.read_bytes()
    for mark, name in (
        (b"\xef\xbb\xbf", "utf-8-sig"),
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
    ):
        if raw.startswith(mark):
            return raw.decode(name, errors="replace")
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' not in line:
        cells = line.split(separator) if line else []
    else:
        try:
            cells = next(csv.reader(io.StringIO(line), delimiter=separator), [])
        except csv.Error as error:
            raise RigtwinError(f"a line that begins {line[:30]!r}: {error}") from None
    return [cell.strip() for cell in cells]


def _look_at(line: str, separator: str, decimal: str) -> Line:
    cells = _cells(line, separator)
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
        cells = _cells(line.lstrip("#%"), found.separator)
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


def split_unit(name: str, unit: str) -> tuple[str, str]:
    """A name and its unit, which may stand in brackets behind it."""
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", name)
    if match and not unit and match.group(1) and is_unit(match.group(2)):
        return match.group(1).strip(), match.group(2)
    return name.strip(), re.sub(r"^[\[(]|[\])]$", "", unit)
