"""MATLAB and parquet files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.numerics.arrays import Array


def read_matlab(path: Path) -> Columns:
    """Vectors, and the columns of matrices. Raises RigtwinError for what MATLAB did not write."""
    from scipy.io import loadmat

    try:
        content: Any = loadmat(str(path), squeeze_me=True, struct_as_record=False)
        form = "MATLAB v5"
    except NotImplementedError:
        content, form = _hdf(path), "MATLAB v7.3"
    except (OSError, RigtwinError):
        raise
    except Exception as error:  # of a damaged file, whatever the reader stumbles over
        raise _unreadable(path, error) from None
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

    def content(group: Any, above: tuple[int, ...] = ()) -> dict[str, Any]:
        found: dict[str, Any] = {}
        above = (*above, h5py.h5o.get_info(group.id).addr)
        for name, item in group.items():
            # A link may lead nowhere.
            if name.startswith("#") or item is None:
                continue
            if not isinstance(item, h5py.Group):
                found[name] = item[()]
            elif h5py.h5o.get_info(item.id).addr not in above:
                # A group may link to one that it stands in.
                found[name] = content(item, above)
        return found

    try:
        with h5py.File(path, "r") as file:
            return content(file)
    except Exception as error:  # of a damaged file, whatever the reader stumbles over
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: Exception) -> RigtwinError:
    said = (str(error).splitlines() or [type(error).__name__])[0]
    return RigtwinError(f"{path} is not a MATLAB file, or damaged: {said}")


def read_parquet(path: Path) -> Columns:
    """Numbers and time stamps. Raises RigtwinError for what is no parquet file."""
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
