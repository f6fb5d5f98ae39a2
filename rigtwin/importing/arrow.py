"""Arrow columns of any type as columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigtwin.importing.columns import numbers_of
from rigtwin.importing.naming import name_items
from rigtwin.numerics.arrays import Array

SECONDS: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Arrow's unit of time → its length, s."""
DAY = 86_400.0
"""Duration of a day, s."""
MOST_ITEMS = 1024
"""Longest lists whose items become columns. Longer lists are pictures or texts."""


@dataclass
class Expansion:
    """Columns of numbers that Arrow columns were expanded to.

    Parameters
    ----------
    values
        Name → numbers, shape (rows,).
    units
        Name → unit, of times and durations.
    wrong
        Name → first cell of a text column that is not a number, and its row.
    refused
        Name → why a column cannot be read as numbers.
    """

    values: dict[str, Array] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    wrong: dict[str, str] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


def expand(columns: Mapping[str, Any], labels: Mapping[str, Sequence[str]]) -> Expansion:
    """Expand Arrow columns to columns of numbers.

    Parameters
    ----------
    columns
        Name → a `pyarrow.ChunkedArray`.
    labels
        Name of a list column → labels of its items.

    Returns
    -------
    Expansion
        Columns of numbers, and the columns that have no clear meaning as numbers.
    """
    expansion = Expansion()
    for name, column in columns.items():
        _expand(name, column, labels, expansion)
    return expansion


def _expand(
    name: str, column: Any, labels: Mapping[str, Sequence[str]], expansion: Expansion
) -> None:
    import pyarrow
    from pyarrow import types

    kind = column.type
    # Dictionary and extension types only wrap another type, which is expanded in their place.
    if types.is_dictionary(kind):
        _expand(name, column.cast(kind.value_type), labels, expansion)
    elif isinstance(kind, pyarrow.BaseExtensionType):
        _expand(name, column.cast(kind.storage_type), labels, expansion)
    elif types.is_struct(kind):
        for place in range(kind.num_fields):
            part = kind.field(place).name
            _expand(f"{name}.{part}", _field_of(column, place), labels, expansion)
    elif (
        types.is_list(kind)
        or types.is_large_list(kind)
        or types.is_fixed_size_list(kind)
        or types.is_list_view(kind)
        or types.is_large_list_view(kind)
    ):
        _expand_lists(name, column, labels, expansion)
    elif types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind):
        _read_texts(name, column, expansion)
    elif (convert := _converter(kind)) is not None:
        expansion.values[name], unit = convert(column)
        expansion.units |= {name: unit} if unit else {}
    else:
        expansion.refused[name] = f"it holds {kind}, which is not numeric"


def _field_of(column: Any, place: int) -> Any:
    """Return one field of a column of structures; null where the structure is."""
    import pyarrow

    # `flatten` rather than `field`: it also applies the nulls of the structure to its fields.
    chunks = [chunk.flatten()[place] for chunk in column.chunks]
    return pyarrow.chunked_array(chunks, column.type.field(place).type)


def _converter(kind: Any) -> Callable[[Any], tuple[Array, str]] | None:
    """Return the function that makes numbers of a plain type, and says their unit."""
    from pyarrow import types

    if types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind):
        return lambda column: (SECONDS[kind.unit] * _integers(column, kind.bit_width), "s")
    if types.is_date32(kind):
        return lambda column: (DAY * _integers(column, 32), "s")
    if types.is_date64(kind):
        return lambda column: (1e-3 * _integers(column, 64), "s")
    if types.is_boolean(kind) or types.is_decimal(kind) or types.is_integer(kind):
        return lambda column: (_floats(column), "")
    if types.is_floating(kind):
        return lambda column: (_floats(column), "")
    return None


def _integers(column: Any, bits: int) -> Array:
    """Return the integers beneath times, in the column's own unit, so that none overflows."""
    import pyarrow

    # Times are cast to plain integers first: Arrow refuses to cast them to floats directly.
    return _floats(column.cast(pyarrow.int64() if bits == 64 else pyarrow.int32()))


def _floats(column: Any) -> Array:
    """Return a column as floats, with NaN for null."""
    import pyarrow

    # An unsafe cast rounds integers above 2^53, which is all that a float can do.
    if not pyarrow.types.is_float64(column.type):
        if pyarrow.types.is_boolean(column.type):
            column = column.cast(pyarrow.int8())
        column = column.cast(pyarrow.float64(), safe=False)
    numbers = np.array(column.to_numpy(), float)
    # Infinity marks a missing value in some programs, and no sensor measures it.
    numbers[np.isinf(numbers)] = np.nan
    return numbers


def _expand_lists(
    name: str, column: Any, labels: Mapping[str, Sequence[str]], expansion: Expansion
) -> None:
    """Expand lists of one length to a column an item."""
    from pyarrow import chunked_array, compute

    if not len(column):
        expansion.refused[name] = "it holds no rows"
        return
    if column.null_count:
        row = int(np.argmax(column.is_null().to_numpy())) + 1
        expansion.refused[name] = f"it holds no list in row {row}"
        return
    lengths = compute.list_value_length(column)  # type: ignore[attr-defined]
    least, most = (value.as_py() for value in compute.min_max(lengths).values())  # type: ignore[attr-defined]
    if least != most:
        expansion.refused[name] = f"it holds lists of {least} to {most} values; expected one length"
        return
    if most > MOST_ITEMS:
        expansion.refused[name] = f"it holds lists of {most} values; expected at most {MOST_ITEMS}"
        return
    # All items one after another; flatten heeds offsets of slices.
    flat = chunked_array([chunk.flatten() for chunk in column.chunks], column.type.value_type)
    inner = Expansion()
    _expand("", flat, {}, inner)
    if inner.refused and not inner.values:
        expansion.refused[name] = next(iter(inner.refused.values()))
        return
    for part, numbers in inner.values.items():
        if len(numbers) != len(column) * most:
            continue
        rows = numbers.reshape(len(column), most)
        for place, item in enumerate(name_items(name, most, labels.get(name, ()))):
            # A list of lists or of structures: `name[0][1]`, `name[0].field`.
            expansion.values[f"{item}{part}"] = np.ascontiguousarray(rows[:, place])


def _read_texts(name: str, column: Any, expansion: Expansion) -> None:
    """Read texts that spell numbers, times of day or dates."""
    cells = ["" if cell is None else cell for cell in column.to_pylist()]
    numbers, wrong = numbers_of(cells, ".")
    if not np.isfinite(numbers).any():
        expansion.refused[name] = "it holds text"
        return
    expansion.values[name] = numbers
    if wrong is not None:
        expansion.wrong[name] = f"{cells[wrong][:40]!r} in row {wrong + 1}"
