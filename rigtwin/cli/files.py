"""Files on a command line: no output may be an input, or another output."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from rigtwin.console import apart
from rigtwin.errors import RigtwinError

OUTPUTS = ("out", "json", "html", "pdf", "png", "draw", "save_twin", "save_mjcf")
"""Options that name a file to be written."""


def check_files(parsed: argparse.Namespace) -> None:
    """Raises RigtwinError if writing one of a command's files would lose another."""
    given = vars(parsed)
    outputs = {
        name: path for name in OUTPUTS if isinstance(path := given.get(name), Path) and path.name
    }
    read = [value for name, value in given.items() if name not in outputs]
    inputs = [path for value in read for path in _files(value)]
    seen: dict[Path, str] = {}
    for name, path in outputs.items():
        option = f"--{name.replace('_', '-')}"
        apart(path, *inputs)
        if (other := seen.setdefault(path.resolve(), option)) != option:
            raise RigtwinError(f"{other} and {option} are both {path}; one would be lost")


def _files(value: object) -> Iterator[Path]:
    """The files that an argument names; a machine is a name or a file."""
    if isinstance(value, list):
        for each in value:
            yield from _files(each)
    elif isinstance(value, str | Path):
        path = Path(value)
        try:
            if path.is_file():
                yield path
        except (OSError, ValueError):
            # A text that is no file's name.
            return
