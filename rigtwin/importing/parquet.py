"""Parquet files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.errors import RigtwinError
from rigtwin.importing.arrow import expand
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format, first_line
from rigtwin.importing.naming import repeated_names
from rigtwin.importing.selection import Selection

if TYPE_CHECKING:
    import pyarrow


def read_parquet(path: Path, selection: Selection) -> Columns:
    """Read the selected columns. Raises RigtwinError for a file that is no parquet file."""
    return read_tables([path], selection)


def read_tables(
    paths: Sequence[Path], selection: Selection, labels: Mapping[str, Sequence[str]] | None = None
) -> Columns:
    """Read the selected columns of files that continue one another.

    Parameters
    ----------
    paths
        Files of one schema, in the order of their rows.
    selection
        Columns that are needed.
    labels
        Name of a list column → labels of its items.

    Returns
    -------
    Columns
        Rows of all files, one file after another.

    Raises
    ------
    RigtwinError
        If a file is no parquet file, or lacks a needed column that the first file has.
    """
    first = _open(paths[0])
    schema = first.schema_arrow
    repeated = repeated_names(schema.names)
    names = [name for name in schema.names if name not in repeated]
    needed = [name for name in names if selection.takes_within(name)]
    import pyarrow

    tables = [_read(path, needed) for path in paths]
    try:
        # Permissive: a column may be an integer in one file and a float in another.
        table = pyarrow.concat_tables(tables, promote_options="permissive")
    except pyarrow.ArrowException as error:
        raise RigtwinError(
            f"{paths[0].parent}: its files do not have the same columns: {first_line(error)}"
        ) from None
    expansion = expand(dict(zip(table.column_names, table.columns, strict=True)), labels or {})
    values = {name: column for name, column in expansion.values.items() if selection.takes(name)}
    listed = (*expansion.values, *(name for name in names if name not in needed))
    return Columns(
        values,
        {name: unit for name, unit in expansion.units.items() if name in values},
        "parquet",
        wrong=expansion.wrong,
        listed=listed,
        refused={**expansion.refused, **repeated},
    )


def _open(path: Path) -> pyarrow.parquet.ParquetFile:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise RigtwinError(
            f"{path}: parquet needs pyarrow: pip install 'rigtwin[import]'"
        ) from None
    if not path.is_file():
        raise RigtwinError(f"cannot read {path}: No such file or directory")
    try:
        return parquet.ParquetFile(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise RigtwinError(f"{path} is not a parquet file: {first_line(error)}") from None


def _read(path: Path, names: Sequence[str]) -> pyarrow.Table:
    import pyarrow

    file = _open(path)
    if missing := [name for name in names if name not in file.schema_arrow.names]:
        raise RigtwinError(f"{path} lacks the column {missing[0]!r} of the other files")
    try:
        # pandas metadata would add index columns that nobody asked for.
        return file.read(columns=list(names), use_pandas_metadata=False)
    except (pyarrow.ArrowException, OSError) as error:
        raise RigtwinError(f"{path} is damaged: {first_line(error)}") from None


FORMAT = Format("parquet", (".parquet", ".pq"), read_parquet)
