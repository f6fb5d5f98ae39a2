"""Columns of numbers out of other programs' files.

CSV however it was written, MATLAB v5 and v7.3, parquet.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, time
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.units import is_unit
from rigtwin.numerics.arrays import Array

SEPARATORS = (";", "\t", ",", "|", " ")
"""In the order in which they are preferred where several would do."""
SURE = 5
"""Lines of as many numbers each that are the beginning of the data."""
HEADER = 400
"""Lines within which the data must begin."""


@dataclass(frozen=True)
class Columns:
    """values.

    Name → numbers, not a number where a cell held none; units: name → as the file says; form: how
    it was read, for people.
    """

    values: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    form: str = ""


@dataclass(frozen=True)
class Layout:
    """How a text file is written. first: line at which the data begin."""

    separator: str
    decimal: str
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]


def read(path: Path) -> Columns:
    """All columns of a file; its kind follows the name's ending.

    Raises RigtwinError saying what is wrong and where.
    """
    readers = {
        ".csv": _text,
        ".txt": _text,
        ".tsv": _text,
        ".dat": _text,
        ".asc": _text,
        ".mat": _matlab,
        ".parquet": _parquet,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise RigtwinError(
            f"{path}: cannot tell its kind; the name must end in {', '.join(readers)}"
        )
    try:
        columns = reader(path)
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror or error}") from None
    if not columns.values:
        raise RigtwinError(f"{path}: it holds no column of numbers")
    return columns


# Text.


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
    cells = next(csv.reader(io.StringIO(line), delimiter=separator), [])
    return [cell.strip() for cell in cells]


def _number(cell: str, decimal: str) -> float:
    """A cell as a number. Raises ValueError."""
    if decimal == ",":
        if "." in cell and "," not in cell:
            raise ValueError(cell)
        cell = cell.replace(".", "").replace(",", ".")
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?")


def _stamp(cell: str) -> float:
    """A date and time, or a time of day, in s. Raises ValueError."""
    text = cell.strip().replace(",", ".")
    if _CLOCK.fullmatch(text):
        clock = time.fromisoformat(
            text.zfill(len(text) + (len(text.split(":")[0]) == 1)) if ":" in text else text
        )
        return 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond
    if not re.match(r"\d{4}-\d{2}-\d{2}[T ]\d", text):
        raise ValueError(cell)
    return datetime.fromisoformat(text).timestamp()


def _value(cell: str, decimal: str) -> float:
    """A number, a time stamp, or nan for an empty or marked cell. Raises ValueError."""
    if cell.strip().lower() in ("", "nan", "na", "n/a", "null", "none", "-", "#n/a", "inf", "-inf"):
        return float("nan")
    try:
        return _number(cell, decimal)
    except ValueError:
        return _stamp(cell)


def _count_numbers(line: str, separator: str, decimal: str) -> int:
    """How many numbers a line holds, 0 if anything else is in it or there are none."""
    cells = _cells(line, separator)
    while cells and not cells[-1]:
        cells.pop()
    numbers = 0
    for cell in cells:
        try:
            numbers += np.isfinite(_value(cell, decimal))
        except ValueError:
            return 0
    return len(cells) if numbers else 0


def find_layout(lines: list[str]) -> Layout | None:
    """How a text is written; None if no lines of numbers are in it."""
    best: tuple[tuple[int, int], Layout] | None = None
    for separator in SEPARATORS:
        for decimal in (".", ","):
            if decimal == separator:
                continue
            counts = [_count_numbers(line, separator, decimal) for line in lines[:HEADER]]
            first = next((n for n in range(len(counts)) if _begins(counts, n)), None)
            if first is None:
                continue
            # The more columns the better; commas that are decimals would else part numbers.
            quality = (counts[first], -SEPARATORS.index(separator))
            if (
                separator == ","
                and all("." not in line for line in lines[first : first + SURE])
                and counts[first] % 2 == 0
            ):
                quality = (counts[first] // 2, -SEPARATORS.index(separator))
            if best is None or quality > best[0]:
                best = (
                    quality,
                    _read_header(lines, Layout(separator, decimal, first, (), ()), counts[first]),
                )
    return None if best is None else best[1]


def _begins(counts: list[int], at: int) -> bool:
    block = [count for count in counts[at : at + SURE]]
    return (
        counts[at] > 0
        and all(count == counts[at] for count in block)
        and (len(block) == SURE or at + len(block) == len(counts))
    )


def _read_header(lines: list[str], found: Layout, columns: int) -> Layout:
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
    pairs = [_split_unit(name, unit) for name, unit in zip(names, units, strict=True)]
    return Layout(
        found.separator,
        found.decimal,
        found.first,
        tuple(n for n, _ in pairs),
        tuple(u for _, u in pairs),
    )


def _split_unit(name: str, unit: str) -> tuple[str, str]:
    """A name and its unit, which may stand in brackets behind it."""
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", name)
    if match and not unit and match.group(1) and is_unit(match.group(2)):
        return match.group(1).strip(), match.group(2)
    return name.strip(), re.sub(r"^[\[(]|[\])]$", "", unit)


def _text(path: Path) -> Columns:
    lines = [line for line in _decode(path).splitlines()]
    while lines and not lines[-1].strip():
        lines.pop()
    found = find_layout(lines)
    if found is None:
        raise RigtwinError(f"{path}: no lines of numbers in its first {HEADER} lines")
    names = list(found.names)
    for name in dict.fromkeys(n for n in names if names.count(n) > 1):
        raise RigtwinError(f"{path}: two columns are named {name!r}")
    rows = list(_rows(path, lines, found))
    table = np.array(rows, float).reshape(len(rows), len(names))
    values = {name: np.ascontiguousarray(table[:, place]) for place, name in enumerate(names)}
    mark = {"\t": "tab", " ": "space"}.get(found.separator, found.separator)
    form = f"text, separated by {mark}, decimal {found.decimal}, data from line {found.first + 1}"
    return Columns(values, {n: u for n, u in zip(names, found.units, strict=True) if u}, form)


def _rows(path: Path, lines: list[str], found: Layout) -> Iterator[list[float]]:
    for number, line in enumerate(lines[found.first :], start=found.first + 1):
        cells = _cells(line, found.separator)
        if not any(cells):
            continue
        while len(cells) > len(found.names) and not cells[-1]:
            cells.pop()
        if len(cells) != len(found.names):
            raise RigtwinError(
                f"{path}: line {number} has {len(cells)} cells; expected {len(found.names)}"
            )
        try:
            yield [_value(cell, found.decimal) for cell in cells]
        except ValueError as error:
            raise RigtwinError(f"{path}: line {number}: {error}; expected numbers") from None


# MATLAB and parquet.


def _matlab(path: Path) -> Columns:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content: Any = loadmat(str(path), squeeze_me=True, struct_as_record=False)
        form = "MATLAB v5"
    except NotImplementedError:
        content, form = _hdf(path), "MATLAB v7.3"
    except (ValueError, MatReadError, TypeError, EOFError) as error:
        raise RigtwinError(f"{path} is not a MATLAB file: {str(error).splitlines()[0]}") from None
    found: dict[str, Array] = {}
    for name, value in content.items():
        if not name.startswith(("__", "#")):
            found.update(_flatten(name, value))
    longest = max((len(each) for each in found.values()), default=0)
    # Scalars are settings, not columns.
    return Columns(
        {name: value for name, value in found.items() if len(value) == longest or len(value) > 1},
        {},
        form,
    )


def _flatten(name: str, value: Any) -> dict[str, Array]:
    """Columns of a variable.

    A vector, a matrix's columns as name:1, name:2, …, a structure's fields as name.field.
    """
    if hasattr(value, "_fieldnames"):
        found: dict[str, Array] = {}
        for each in value._fieldnames:
            found.update(_flatten(f"{name}.{each}", getattr(value, each)))
        return found
    if isinstance(value, dict):
        found = {}
        for each, inner in value.items():
            found.update(_flatten(f"{name}.{each}", inner))
        return found
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return {}
    array = np.squeeze(array).astype(float)
    if array.ndim == 1:
        return {name: array}
    if array.ndim == 2:
        if array.shape[0] < array.shape[1]:
            array = array.T
        return {
            f"{name}:{number + 1}": np.ascontiguousarray(array[:, number])
            for number in range(array.shape[1])
        }
    return {}


def _hdf(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise RigtwinError(
            f"{path} is MATLAB v7.3, which needs h5py: pip install 'rigtwin[import]'"
        ) from None

    def content(group: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, item in group.items():
            if name.startswith("#"):
                continue
            found[name] = content(item) if isinstance(item, h5py.Group) else item[()]
        return found

    with h5py.File(path, "r") as file:
        return content(file)


def _parquet(path: Path) -> Columns:
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise RigtwinError(
            f"{path}: parquet needs pyarrow: pip install 'rigtwin[import]'"
        ) from None
    if not path.is_file():
        raise RigtwinError(f"cannot read {path}: No such file or directory")
    try:
        table = parquet.read_table(path)
    except pyarrow.ArrowException as error:
        raise RigtwinError(f"{path} is not a parquet file: {str(error).splitlines()[0]}") from None
    found: dict[str, Array] = {}
    for name in table.column_names:
        column = table[name]
        if pyarrow.types.is_timestamp(column.type):
            found[name] = (
                column.cast(pyarrow.timestamp("ns")).cast(pyarrow.int64()).to_numpy().astype(float)
                * 1e-9
            )
        elif pyarrow.types.is_integer(column.type) or pyarrow.types.is_floating(column.type):
            found[name] = column.to_numpy().astype(float)
    return Columns(found, {}, "parquet")
