"""Files on a command line: no output may be an input, or another output, or impossible to write."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from rigtwin.console import writable
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting

OUTPUTS = ("out", "json", "html", "pdf", "png", "draw", "save_twin", "save_mjcf")
"""Options that name a file to be written; `out` names a folder in some commands."""


def check_files(parsed: argparse.Namespace) -> None:
    """Raises RigtwinError, before the work for them is done, if one of a command's files cannot be
    written or if writing it would lose another."""
    arguments = vars(parsed)
    outputs = {name: path for name in OUTPUTS if isinstance(path := arguments.get(name), Path)}
    read = [value for name, value in arguments.items() if name not in outputs]
    inputs = [path for value in read for path in _files(value)]
    # Only an output that exists can overwrite a machine's file; finding those files takes a
    # second.
    if any(path.exists() for path in outputs.values()):
        inputs += _machine_files(arguments.get("machine"))
    seen: dict[Path, str] = {}
    for name, path in outputs.items():
        option = f"--{name.replace('_', '-')}"
        forbid_overwriting(path, *inputs)
        if name != "out":
            writable(path)
        if (first := seen.setdefault(path.resolve(), option)) != option:
            raise RigtwinError(f"{first} and {option} are both {path}; one would be lost")


def _machine_files(name: object) -> tuple[Path, ...]:
    """Return the files of a machine; none if it cannot be read, which its user reports."""
    if not isinstance(name, str):
        return ()
    from rigtwin.description import catalogue  # Late: MuJoCo takes a second.

    with suppress(RigtwinError):
        return catalogue.find(name).files
    return ()


def _files(value: object) -> Iterator[Path]:
    """The files that an argument names; a machine is a name or a file."""
    if isinstance(value, list):
        for item in value:
            yield from _files(item)
    elif isinstance(value, str | Path):
        path = Path(value)
        try:
            if path.is_file():
                yield path
        except (OSError, ValueError):
            # A text that is no file's name.
            return
