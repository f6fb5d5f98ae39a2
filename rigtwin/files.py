"""Files: atomic writing, checks of paths, and TOML."""

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
"""Number of characters of a file's name that its temporary copy keeps."""
INTEGER = 64
"""Size of an integer in TOML, in bits."""


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file completely, or leave it as it was.

    Parameters
    ----------
    path
        Path of the file. A device such as /dev/stdout is written to directly.
    content
        Bytes, or text to be encoded as UTF-8. Characters that cannot be encoded, as in file names
        of another encoding, become question marks.

    Raises
    ------
    RigtwinError
        If the file cannot be written.
    """
    data = content.encode("utf-8", "replace") if isinstance(content, str) else content
    try:
        with atomic_path(path) as beside:
            beside.write_bytes(data)
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Provide a temporary path that replaces a file after success, and is deleted after failure.

    Parameters
    ----------
    path
        Path of the file. For a device such as /dev/stdout the path itself is provided.

    Yields
    ------
    Path
        Path to write to.
    """
    # Links are resolved, so that the file they point to is replaced and not the link.
    target = path.resolve()
    if target.exists() and not target.is_file():
        yield target
        return
    # In the same folder, because a rename is atomic only within one file system.
    beside = target.with_name(f"{target.name[:LONGEST]}.{uuid4().hex[:8]}.part")
    try:
        yield beside
        if target.exists():
            # The new file keeps the old one's permissions.
            shutil.copymode(target, beside)
        beside.replace(target)
    except BaseException as error:
        with suppress(OSError):
            beside.unlink()
        if isinstance(error, RigtwinError):
            # The user knows the file by its own name, not by the temporary one.
            raise RigtwinError(str(error).replace(str(beside), str(path))) from None
        raise


def forbid_overwriting(out: str | Path, *inputs: Path) -> Path:
    """Return the path of an output unless it is one of the inputs.

    Parameters
    ----------
    out
        Path of the output.
    inputs
        Paths of the inputs, which need not exist.

    Returns
    -------
    Path
        Path of the output.

    Raises
    ------
    RigtwinError
        If the output is one of the inputs, which would be lost.
    """
    path = Path(out)
    # samefile also recognises links and other spellings of a path.
    if path.exists() and any(other.exists() and path.samefile(other) for other in inputs):
        raise RigtwinError(f"{path} is the input; name another output")
    return path


def require_path(path: Path) -> None:
    """Raise RigtwinError for a text that cannot be a file name."""
    if "\0" in str(path):
        raise RigtwinError(f"{str(path)!r:.60} cannot be a file name: it has a zero byte")


def recordable(out: str | Path) -> Path:
    """Return a path to which a recording can be written and from which it can be read.

    Raises RigtwinError for a device or a pipe, before a test runs in vain.
    """
    path = Path(out)
    require_path(path)
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "no file but a device or a pipe"
        raise RigtwinError(f"cannot record to {path}: it is {kind}")
    return path


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text. Raise ValueError if it is not TOML.

    TOML's integers have 64 bits. Python parses longer ones, but cannot print thousands of digits.
    """
    document = tomllib.loads(text)
    # A loop instead of recursion: nesting may be deeper than Python's stack.
    waiting: list[object] = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value
        elif isinstance(value, int) and value.bit_length() > INTEGER:
            raise ValueError(f"an integer of {value.bit_length()} bits; expected {INTEGER} at most")
    return document


def printable(text: str) -> str:
    """Return a foreign text in one line, without characters that could control a terminal."""
    return "".join(char if char.isprintable() else "?" for char in text)
