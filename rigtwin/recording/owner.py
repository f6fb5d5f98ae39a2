"""A file that one program alone writes."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from typing import BinaryIO

from rigtwin.errors import RigtwinError

if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def open_alone(path: Path) -> BinaryIO:
    """Opens a file to be written from its beginning, for as long as it is open by nobody else.

    Parameters
    ----------
    path
        Replaced if it is there, but only once it is this program's own.

    Returns
    -------
    BinaryIO
        Without a buffer.

    Raises
    ------
    RigtwinError
        If another program is writing it.
    OSError
        If it cannot be written.
    """
    binary = getattr(os, "O_BINARY", 0)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | binary, 0o666)
    try:
        if stat.S_ISREG(os.fstat(handle).st_mode):
            try:
                _lock(handle)
            except OSError:
                raise RigtwinError(
                    f"{path} is being written by another program; name another output"
                ) from None
            os.ftruncate(handle, 0)
        return os.fdopen(handle, "wb", buffering=0)
    except BaseException:
        os.close(handle)
        raise
