"""Files: written whole or not at all; TOML as its standard has it."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from rigtwin.errors import RigtwinError

LONGEST = 100
"""Characters of a name that its half-written copy keeps."""
INTEGER = 64
"""Bits of an integer in TOML."""


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file that stays as it was, or away, if that fails half-way.

    Parameters
    ----------
    path
        Where to. What is no plain file, such as /dev/stdout, is written to directly.
    content
        Its bytes, or its text, which becomes UTF-8; what is none, such as the name of a file in
        another encoding, becomes question marks.

    Raises
    ------
    RigtwinError
        If it cannot be written.
    """
    data = content.encode("utf-8", "replace") if isinstance(content, str) else content
    try:
        with written_whole(path) as beside:
            beside.write_bytes(data)
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file beside another, whose place it takes once it is written; it goes if that fails.

    Parameters
    ----------
    path
        Where to. What is no plain file, such as /dev/stdout, is given itself.

    Yields
    ------
    Path
        Where to write.
    """
    target = path.resolve()
    if target.exists() and not target.is_file():
        yield target
        return
    beside = target.with_name(f"{target.name[:LONGEST]}.{uuid4().hex[:8]}.part")
    try:
        yield beside
        if target.exists():
            shutil.copymode(target, beside)
        beside.replace(target)
    except BaseException as error:
        with suppress(OSError):
            beside.unlink()
        if isinstance(error, RigtwinError):
            # The operator knows the file by its name.
            raise RigtwinError(str(error).replace(str(beside), str(path))) from None
        raise


def keep_apart(out: str | Path, *inputs: Path) -> Path:
    """A file to be written that is none of those that are read.

    Parameters
    ----------
    out
        Where to.
    inputs
        What the work is made of; what is not there counts for nothing.

    Returns
    -------
    Path
        The output's.

    Raises
    ------
    RigtwinError
        If it is one of the inputs, which would be lost.
    """
    path = Path(out)
    if path.exists() and any(each.exists() and path.samefile(each) for each in inputs):
        raise RigtwinError(f"{path} is the input; name another output")
    return path


def require_path(path: Path) -> None:
    """Raises RigtwinError for what no file can be called."""
    if "\0" in str(path):
        raise RigtwinError(f"{str(path)!r:.60} is no name of a file: it has a zero byte")


def recordable(out: str | Path) -> Path:
    """A file that a recording can be written to and read from again. Raises RigtwinError for a
    device or a pipe, before a test runs for nothing."""
    path = Path(out)
    require_path(path)
    if path.exists() and not path.is_file():
        what = "a folder" if path.is_dir() else "no file but a device or a pipe"
        raise RigtwinError(f"cannot record to {path}: it is {what}")
    return path


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML. Raises ValueError if it is none; integers have 64 bits there, and
    Python cannot even print those of thousands of digits."""
    document = tomllib.loads(text)
    waiting: list[object] = [document]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            waiting += each.values()
        elif isinstance(each, list):
            waiting += each
        elif isinstance(each, int) and each.bit_length() > INTEGER:
            raise ValueError(f"an integer of {each.bit_length()} bits; expected {INTEGER} at most")
    return document


def printable(text: str) -> str:
    """A text of another program in one line, without what would command a terminal."""
    return "".join(each if each.isprintable() else "?" for each in text)
