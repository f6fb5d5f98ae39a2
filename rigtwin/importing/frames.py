"""Data that are in memory already: pandas DataFrames, Arrow tables, arrays by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns, numbers_of
from rigtwin.importing.naming import name_items, repeated_names, split_unit
from rigtwin.importing.selection import Selection
from rigtwin.numerics.arrays import Array

EXPECTED = "a path, a pandas DataFrame, an Arrow table, or a dictionary of name → array"


def read_frame(data: object, selection: Selection) -> Columns:
    """Read the selected columns of data in memory.

    Parameters
    ----------
    data
        pandas DataFrame, whose named index is a column too; Arrow table; numpy array with named
        fields; or mapping name → array. An array of shape (rows, items) becomes `name[0]`,
        `name[1]`, ….
    selection
        Columns that are needed.

    Returns
    -------
    Columns
        Times and dates in s.

    Raises
    ------
    RigtwinError
        For data of another kind, and columns of different lengths.
    """
    pairs, form = _list_columns(data)
    refused = repeated_names(name for name, _ in pairs)
    values: dict[str, Array] = {}
    units: dict[str, str] = {}
    wrong: dict[str, str] = {}
    listed: list[str] = []
    for name, column in pairs:
        if name in refused:
            continue
        if not selection.takes_within(name):
            listed.append(name)
            continue
        try:
            numbers, unit = _numbers(name, column, wrong)
        except (TypeError, ValueError, OverflowError) as error:
            refused[name] = str(error).splitlines()[0] if str(error) else "it holds no numbers"
            continue
        values |= numbers
        listed += numbers
        unit = unit or split_unit(name, "")[1]
        units |= dict.fromkeys(numbers, unit) if unit else {}
    _require_one_length(values)
    return Columns(values, units, form, (), wrong, tuple(listed), refused)


def _require_one_length(values: Mapping[str, Array]) -> None:
    first = next(iter(values), "")
    for name, column in values.items():
        if len(column) != len(values[first]):
            raise RigtwinError(
                f"column {name!r} has {len(column)} rows, and {first!r} has {len(values[first])}; "
                "expected equally many"
            )


def _list_columns(data: Any) -> tuple[list[tuple[str, Any]], str]:
    """Return the names and columns of data in memory, and what kind of data it is."""
    if isinstance(data, Mapping):
        return [(str(name), column) for name, column in data.items()], "arrays"
    if isinstance(data, np.ndarray) and data.dtype.names:
        return [(name, data[name]) for name in data.dtype.names], "array with named fields"
    # An Arrow table. pandas objects are known by `iloc`, so that neither package is imported.
    if hasattr(data, "to_pandas") and not hasattr(data, "iloc"):
        data = data.to_pandas()
    if hasattr(data, "columns") and hasattr(data, "iloc"):
        # A named index is data, such as the time; an unnamed one counts rows.
        index = [] if data.index.name is None else [(str(data.index.name), data.index)]
        columns = [(_label(name), data.iloc[:, place]) for place, name in enumerate(data.columns)]
        return index + columns, "table"
    raise RigtwinError(f"data {type(data).__name__}: expected {EXPECTED}")


def _label(name: object) -> str:
    """Return a column's name; the levels of a multi-index are joined by dots."""
    return ".".join(map(str, name)) if isinstance(name, tuple) else str(name)


def _numbers(name: str, column: Any, wrong: dict[str, str]) -> tuple[dict[str, Array], str]:
    """Return a column's numbers by name, and their unit. Raises TypeError, ValueError or
    OverflowError."""
    if isinstance(column, np.ma.MaskedArray):
        column = _without_mask(column)
    try:
        array: Any = np.asarray(column)
    except ValueError:
        raise ValueError("it holds lists of different lengths; expected one length") from None
    if array.dtype.kind == "O":
        array = _unpack(array)
    if array.dtype.kind in "Mm":
        return {name: _seconds(array)}, "s"
    if array.dtype.kind in "SU":
        array = array.astype(str)
        cells = [str(cell) for cell in array]
        numbers, row = numbers_of(cells, ".")
        if not np.isfinite(numbers).any():
            raise ValueError("it holds text")
        if row is not None:
            wrong[name] = f"{cells[row][:40]!r} in row {row + 1}"
        return {name: numbers}, ""
    if array.dtype.kind not in "fiub":
        raise TypeError(f"it holds {array.dtype}, which is not numeric")
    array = array.astype(float)
    array[np.isinf(array)] = np.nan
    if array.ndim == 0:
        raise ValueError("it holds a single value; expected one a row")
    if array.ndim == 1:
        return {name: array}, ""
    items = array.reshape(len(array), -1)
    names = name_items(name, items.shape[1])
    return {item: np.ascontiguousarray(items[:, n]) for n, item in enumerate(names)}, ""


def _without_mask(column: Any) -> Array:
    """Return a masked array as a plain one, with NaN where the mask hides a value."""
    if column.dtype.kind in "fiub":
        return column.astype(float).filled(np.nan)
    if column.dtype.kind in "Mm":
        return column.filled(column.dtype.type("NaT"))
    if np.ma.getmaskarray(column).any():
        raise ValueError(f"it holds masked values of {column.dtype}, which is not numeric")
    return column.data


def _unpack(array: Array) -> Array:
    """Return a column of Python objects as numbers, dates, texts, or a matrix of list items."""
    cells = array.tolist()
    if any(isinstance(cell, Sequence | np.ndarray) and not isinstance(cell, str) for cell in cells):
        lengths = {len(cell) if hasattr(cell, "__len__") else -1 for cell in cells}
        if len(lengths) > 1:
            raise ValueError("it holds lists of different lengths; expected one length")
        return np.stack([np.asarray(cell) for cell in cells])
    if any(isinstance(cell, str) for cell in cells):
        # `cell != cell` holds for NaN, which pandas stores in place of missing texts.
        return np.array(["" if cell is None or cell != cell else str(cell) for cell in cells])
    # Dates of Python and pandas are read as text, like those of files.
    if any(hasattr(cell, "isoformat") for cell in cells):
        return np.array([str(cell) for cell in cells])
    return np.array([np.nan if cell is None else float(cell) for cell in cells])


def _seconds(array: Any) -> Array:
    """Return dates since 1970 or durations in s, with NaN for missing ones."""
    unit, count = np.datetime_data(array.dtype)
    # Years and months have no fixed length, so they become days first.
    if unit in ("Y", "M"):
        array, (unit, count) = array.astype("datetime64[D]"), ("D", 1)
    length = {"W": 604800.0, "D": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3}
    length |= {"us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15, "as": 1e-18}
    if unit not in length:
        raise ValueError("it holds times without a unit; expected a type such as timedelta64[ns]")
    # NaT is the smallest integer here, and replaced in the next line.
    numbers = count * length[unit] * array.astype(np.int64).astype(float)
    numbers[np.isnat(array)] = np.nan
    return numbers
