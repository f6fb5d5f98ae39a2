"""Columns of numbers out of other programs' files, by the ending of their names."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format
from rigtwin.importing.selection import EVERYTHING, Selection


@cache
def formats() -> tuple[Format, ...]:
    """Return all formats: `FORMAT` of each module of this package that defines one."""
    package = __name__.rpartition(".")[0]
    names = [module.name for module in iter_modules([str(Path(__file__).parent)])]
    modules = [import_module(f"{package}.{name}") for name in names]
    return tuple(module.FORMAT for module in modules if hasattr(module, "FORMAT"))


def find_format(path: Path) -> Format:
    """Return the format of a file or folder.

    Raises
    ------
    RigtwinError
        If no format has the file's ending, or takes the folder.
    """
    if path.is_dir():
        for known in formats():
            if known.is_folder(path):
                return known
        expected = ", ".join(known.title for known in formats() if "folder" in known.title)
        raise RigtwinError(f"{path}: a folder of an unknown kind; expected {expected}")
    name = path.name.lower()
    for known in formats():
        if name.endswith(known.endings):
            return known
    endings = ", ".join(ending for known in formats() for ending in known.endings)
    raise RigtwinError(f"{path}: cannot tell its kind; the name must end in {endings}")


def read(path: Path, selection: Selection = EVERYTHING) -> Columns:
    """Read columns of a file, or of a folder of files; its kind follows the name's ending.

    Parameters
    ----------
    path
        File or folder.
    selection
        Columns and episodes that are needed. Defaults to all.

    Returns
    -------
    Columns
        The needed columns, and the names of all.

    Raises
    ------
    RigtwinError
        If the file cannot be read, or holds no column of numbers.
    """
    known = find_format(path)
    try:
        columns = known.read(path, selection)
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror or error}") from None
    # Better here than later as an unknown column: the file is the wrong one, not the map.
    if not columns.names:
        refused = "".join(
            f"; column {name!r}: {why}" for name, why in list(columns.refused.items())[:3]
        )
        raise RigtwinError(f"{path}: it holds no column of numbers{refused}")
    return columns
