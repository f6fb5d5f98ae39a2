"""MATLAB files: v5, and v7.3, of which only the mapped datasets are read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format, first_line
from rigtwin.importing.selection import Selection
from rigtwin.numerics.arrays import Array

NUMBERS = "fiub"
"""Kinds of data type that hold numbers, as numpy names them."""


def read_matlab(path: Path, selection: Selection) -> Columns:
    """Read vectors and the columns of matrices.

    A matrix's columns are `name:1`, `name:2`, …, a structure's fields `name.field`. Raises
    RigtwinError for a file that MATLAB did not write.
    """
    from scipy.io import loadmat

    try:
        content: Any = loadmat(str(path), squeeze_me=True, struct_as_record=False)
    # scipy's way to say that the file is HDF5, which MATLAB writes since v7.3.
    except NotImplementedError:
        return _read_hdf(path, selection)
    except (OSError, RigtwinError):
        raise
    except Exception as error:  # The reader raises errors of any kind for a damaged file.
        raise _unreadable(path, error) from None
    columns: dict[str, Array] = {}
    for name, value in content.items():
        if not name.startswith(("__", "#")):
            columns.update(_flatten(name, value))
    longest = max(map(len, columns.values()), default=0)
    wanted = {
        name: len(value) for name, value in columns.items() if _is_column(len(value), longest)
    }
    values = {name: columns[name] for name in wanted if selection.takes(name)}
    return Columns(values, {}, "MATLAB v5", listed=tuple(wanted))


def _is_column(length: int, longest: int) -> bool:
    """Return whether a variable is a column. Scalars are settings."""
    return length == longest or length > 1


def _flatten(name: str, value: Any) -> dict[str, Array]:
    """Return the columns of a variable of a v5 file."""
    if hasattr(value, "_fieldnames"):
        columns: dict[str, Array] = {}
        for field in value._fieldnames:
            columns.update(_flatten(f"{name}.{field}", getattr(value, field)))
        return columns
    array = np.asarray(value)
    if array.dtype.kind not in NUMBERS:
        return {}
    # Vectors are matrices in MATLAB, with one axis of length 1.
    array = np.squeeze(array)
    return {
        column: _take(array, number) for column, number in _name_columns(name, array.shape).items()
    }


def _name_columns(name: str, shape: tuple[int, ...]) -> dict[str, int]:
    """Return the columns of an array without axes of length one: name → number of the column.

    Scalars and arrays of three axes and more have none.
    """
    if len(shape) == 1:
        return {name: 0}
    if len(shape) == 2:
        # The longer axis is taken as time, so a matrix has as many columns as its shorter one.
        return {f"{name}:{number + 1}": number for number in range(min(shape))}
    return {}


def _take(array: Array, number: int) -> Array:
    """Return one column of a vector or of a matrix, whose longer axis holds the rows."""
    if array.ndim == 2:
        array = array[:, number] if array.shape[0] >= array.shape[1] else array[number]
    return np.ascontiguousarray(array, float)


def _read_hdf(path: Path, selection: Selection) -> Columns:
    try:
        import h5py
    except ImportError:
        raise RigtwinError(
            f"{path} is MATLAB v7.3, which needs h5py: pip install 'rigtwin[import]'"
        ) from None
    columns: dict[str, tuple[Any, int, int]] = {}

    def list_columns(prefix: str, group: Any, above: tuple[int, ...] = ()) -> None:
        # Addresses of the objects above, since one object may have several names.
        above = (*above, h5py.h5o.get_info(group.id).addr)
        for name, item in group.items():
            # A link may lead nowhere.
            # Names with # are MATLAB's own, such as #refs#, and hold the contents of cells.
            if name.startswith("#") or item is None:
                continue
            if isinstance(item, h5py.Group):
                # A group may link to one that it stands in.
                if h5py.h5o.get_info(item.id).addr not in above:
                    list_columns(f"{prefix}{name}.", item, above)
            elif item.dtype.kind in NUMBERS:
                shape = tuple(length for length in item.shape or () if length != 1)
                for column, number in _name_columns(f"{prefix}{name}", shape).items():
                    columns[column] = (item, number, max(shape))

    values: dict[str, Array] = {}
    listed: list[str] = []
    try:
        with h5py.File(path, "r") as file:
            list_columns("", file)
            longest = max((length for _, _, length in columns.values()), default=0)
            name, content = "", np.empty(0)
            for column, (item, number, length) in columns.items():
                if not _is_column(length, longest):
                    continue
                listed.append(column)
                if not selection.takes(column):
                    continue
                # The columns of one matrix come one after another; it is read from disk once.
                if item.name != name:
                    name, content = item.name, np.squeeze(item[()])
                values[column] = _take(content, number)
    except Exception as error:  # The reader raises errors of any kind for a damaged file.
        raise _unreadable(path, error) from None
    return Columns(values, {}, "MATLAB v7.3", listed=tuple(listed))


def _unreadable(path: Path, error: Exception) -> RigtwinError:
    return RigtwinError(f"{path} is not a MATLAB file, or damaged: {first_line(error)}")


FORMAT = Format("MATLAB", (".mat",), read_matlab)
