"""Helpers shared by all commands: settings, checks of outputs, tables, and JSON."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, require_path

if TYPE_CHECKING:
    from rigtwin.recording import RecordedTest


def assigned_settings(texts: Sequence[str]) -> list[dict[str, dict[str, str]]]:
    """Return the changes of `--set`. Raise RigtwinError for a text that is no assignment."""
    from rigtwin.description.changes import parse_assignments

    return list(parse_assignments(texts))


def writable(out: Path) -> None:
    """Raise RigtwinError if a file cannot be written, before the work for it is done."""
    require_path(out)
    if not out.name:
        raise RigtwinError("an output without a name; expected a file")
    if out.is_dir():
        raise RigtwinError(f"cannot write {out}: it is a folder")
    if not out.parent.is_dir():
        raise RigtwinError(f"cannot write {out}: its folder does not exist")
    if not os.access(out if out.exists() else out.parent, os.W_OK):
        raise RigtwinError(f"cannot write {out}: permission denied")


def tell_notes(recording: RecordedTest) -> None:
    """Print the notes of a recording on standard error."""
    for note in recording.notes:
        print(f"note: {recording.path}: {note}", file=sys.stderr)


def table(rows: list[tuple[str, ...]]) -> str:
    """Return rows as text with aligned columns."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def late(figures: Mapping[str, str]) -> str:
    """Return the lateness of a recorded loop in real time, in words."""
    try:
        times = [
            f"{1e6 * float(figures.get(f'late_{figure}', 'nan')):.3g} us"
            for figure in ("median", "999", "max")
        ]
    except ValueError:
        return "its lateness cannot be read"
    return (
        f"late by {times[0]} in the median, {times[1]} at the "
        f"99.9th percentile, {times[2]} at most; "
        f"{figures.get('missed')} ticks missed; {figures.get('scheduling')}"
    )


def finite(document: object) -> object:
    """Return a document with null in place of numbers that are not finite, which JSON lacks."""
    # Recursion covers documents of nested tables and lists.
    if isinstance(document, float):
        return document if math.isfinite(document) else None
    if isinstance(document, dict):
        return {key: finite(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [finite(value) for value in document]
    return document


def write_json(path: Path, document: object) -> None:
    """Write a document as JSON. Raise RigtwinError if the file cannot be written."""
    atomic_write(path, json.dumps(finite(document), indent=1, allow_nan=False) + "\n")
