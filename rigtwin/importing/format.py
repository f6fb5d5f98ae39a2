"""Format: a kind of file that can be imported, and the function that reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rigtwin.importing.columns import Columns
from rigtwin.importing.selection import Selection


def _is_never_a_folder(_: Path) -> bool:
    return False


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its type if it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]


@dataclass(frozen=True)
class Format:
    """A kind of file.

    A module of this package that defines `FORMAT` is found by `table.formats`; nothing else has
    to be edited.

    Parameters
    ----------
    title
        Name for messages, such as "LeRobot dataset (a folder)".
    endings
        Endings of the file names, in lower case, with the dot.
    read
        Reads the selected columns of a file or folder. Raises RigtwinError, or OSError.
    is_folder
        Whether a folder is of this kind.
    """

    title: str
    endings: tuple[str, ...]
    read: Callable[[Path, Selection], Columns]
    is_folder: Callable[[Path], bool] = _is_never_a_folder
