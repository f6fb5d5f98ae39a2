"""Columns of numbers out of other programs' files, by the ending of their names."""

from __future__ import annotations

from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.containers import read_matlab, read_parquet
from rigtwin.importing.records import read_json
from rigtwin.importing.text import read_text

READERS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat", ".asc", ".log"), read_text),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), read_json),
    ".mat": read_matlab,
    ".parquet": read_parquet,
}
"""Ending → what reads it."""


def read(path: Path) -> Columns:
    """All columns of a file; its kind follows the name's ending.

    Raises RigtwinError saying what is wrong and where.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise RigtwinError(
            f"{path}: cannot tell its kind; the name must end in {', '.join(READERS)}"
        )
    try:
        columns = reader(path)
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror or error}") from None
    if not columns.values:
        raise RigtwinError(f"{path}: it holds no column of numbers")
    return columns
