"""Large text files of plain numbers, read by Arrow, which takes only the needed columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from rigtwin.importing.columns import MISSING
from rigtwin.importing.lines import open_bytes
from rigtwin.numerics.arrays import Array

LARGE = 4_000_000
"""Bytes from which reading by Arrow is worth loading it."""
BLOCK = 1 << 20
"""Bytes of a file that Arrow reads at a time."""
SPELLINGS = sorted({s for m in MISSING for s in (m, m.upper(), m.capitalize(), "NaN", "N/A")})
"""Cells that hold no value. Any other spelling is left to the slower reader."""


def read_plain(
    path: Path,
    encoding: str,
    head: Sequence[str],
    separator: str,
    decimal: str,
    wide: int,
    places: Sequence[int],
) -> Mapping[int, Array] | None:
    """Read the needed columns of a large text file, if all of its rows are plain numbers.

    Parameters
    ----------
    path
        The file.
    encoding
        Its encoding.
    head
        Lines before the data.
    separator, decimal
        Separator of the cells, and the decimal sign.
    wide
        Number of columns.
    places
        Places of the needed columns.

    Returns
    -------
    mapping or None
        Place → numbers, shape (rows,). None if Arrow is not installed, the file is small, or it
        holds anything else than plain numbers: `cells.gather_rows` then says what.
    """
    if path.stat().st_size < LARGE or encoding == "utf-16" or separator == " " or not places:
        return None
    try:
        import pyarrow
    except ImportError:
        return None
    try:
        with open_bytes(path) as file:
            for line in head:
                # The head was split as text. Where bytes split otherwise, such as at a lone
                # carriage return, Arrow would begin in the wrong line.
                if file.readline().decode(encoding, "replace").rstrip("\r\n") != line:
                    return None
            parts = _read_blocks(file, separator, decimal, wide, [str(place) for place in places])
    except pyarrow.ArrowException:
        return None
    if parts is None:
        return None
    # Popped, so that the parts of one column at a time are in memory twice.
    return {place: np.concatenate(parts.pop(str(place))) for place in places}


def _read_blocks(
    file: BinaryIO, separator: str, decimal: str, wide: int, names: Sequence[str]
) -> dict[str, list[Array]] | None:
    """Return the blocks of each needed column; None if anything is no plain number."""
    import pyarrow
    from pyarrow import csv

    odd = False

    def refuse(_: object) -> str:
        nonlocal odd
        odd = True
        return "skip"

    reader = csv.open_csv(
        file,
        csv.ReadOptions(
            use_threads=False, block_size=BLOCK, column_names=[str(place) for place in range(wide)]
        ),
        csv.ParseOptions(delimiter=separator, invalid_row_handler=refuse),
        csv.ConvertOptions(
            include_columns=names,
            column_types=dict.fromkeys(names, pyarrow.float64()),
            null_values=SPELLINGS,
            decimal_point=decimal,
            check_utf8=False,
        ),
    )
    parts: dict[str, list[Array]] = {name: [] for name in names}
    for batch in reader:
        if odd:
            return None
        columns = [batch.column(name).to_numpy(zero_copy_only=False) for name in names]
        if np.all([np.isnan(column) for column in columns], axis=0).any():
            # Maybe a blank line, which only the slower reader tells from missing cells.
            return None
        for name, column in zip(names, columns, strict=True):
            # A copy, or the whole block would stay in memory.
            parts[name].append(np.where(np.isinf(column), np.nan, column))
    # The handler may have been called in the last block.
    return None if odd or not parts[names[0]] else parts
