"""Lines of a text file, plain or compressed by gzip, in whatever encoding it is written."""

from __future__ import annotations

import codecs
import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from rigtwin.errors import RigtwinError

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""First bytes of a file that state its encoding."""
PIECE = 1 << 20
"""Bytes that are looked at at a time."""


@contextmanager
def open_bytes(path: Path) -> Iterator[BinaryIO]:
    """Open a file, uncompressed if its name ends in `.gz`.

    Raises
    ------
    RigtwinError
        If the file is not what gzip writes, or cut off.
    """
    if path.suffix.lower() != ".gz":
        with path.open("rb") as file:
            yield file
        return
    try:
        with gzip.open(path, "rb") as packed:
            yield cast(BinaryIO, packed)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RigtwinError(f"{path} is not a gzip file, or cut off: {error}") from None


def find_encoding(path: Path) -> str:
    """Return the encoding of a text file: what its first bytes state, UTF-8 if all of it is UTF-8,
    else Latin-1."""
    with open_bytes(path) as file:
        piece = file.read(PIECE)
        # UTF-16 is recognised by its mark alone; its zero bytes would also be valid UTF-8.
        for mark, name in MARKS:
            if piece.startswith(mark):
                return name
        # Incremental, because a piece may end within a character.
        decoder = codecs.getincrementaldecoder("utf-8")()
        try:
            while piece:
                decoder.decode(piece)
                piece = file.read(PIECE)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            # Latin-1 assigns a character to every byte, so it never fails.
            return "latin-1"
    return "utf-8"


def read_lines(path: Path, encoding: str) -> Iterator[str]:
    """Yield the lines of a text file without their ends, one at a time."""
    with open_bytes(path) as file:
        # The mark of UTF-8 and UTF-16 is no part of the text.
        text = io.TextIOWrapper(cast(Any, file), encoding, errors="replace")
        for line in text:
            # Unlike the file's own iterator, splitlines also ends lines at form feeds and other
            # separators.
            yield from line.splitlines()


def is_cut_off(path: Path, encoding: str) -> bool:
    """Return whether a text file ends within a line. A compressed file counts as complete, since
    gzip states its length."""
    if path.suffix.lower() == ".gz":
        return False
    width = 2 if encoding == "utf-16" else 1
    with path.open("rb") as file:
        file.seek(-width, io.SEEK_END)
        return file.read().strip(b"\0") not in (b"\n", b"\r")
