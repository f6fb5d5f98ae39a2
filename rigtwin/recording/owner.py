"""A file that one program alone writes."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from rigtwin.errors import RigtwinError
from rigtwin.system import lock_file


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
                lock_file(handle)
            except OSError:
                raise RigtwinError(
                    f"{path} is being written by another program; name another output"
                ) from None
            os.ftruncate(handle, 0)
        return os.fdopen(handle, "wb", buffering=0)
    except BaseException:
        os.close(handle)
        raise
