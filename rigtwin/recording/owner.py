"""Exclusive access to a file that a program writes."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from rigtwin.errors import RigtwinError
from rigtwin.system import lock_file


def open_alone(path: Path) -> BinaryIO:
    """Open a file for writing from its beginning, exclusively for as long as it is open.

    The file is truncated only after it is locked: a second writer must not destroy the first's.

    Parameters
    ----------
    path
        Path of the file, which is replaced if it exists.

    Returns
    -------
    BinaryIO
        Unbuffered file.

    Raises
    ------
    RigtwinError
        If another program is writing the file.
    OSError
        If the file cannot be written.
    """
    # Windows would otherwise translate line ends.
    binary = getattr(os, "O_BINARY", 0)
    # No O_TRUNC: the content must survive until the lock is ours.
    handle = os.open(path, os.O_RDWR | os.O_CREAT | binary, 0o666)
    try:
        # Devices and pipes cannot be locked or truncated.
        if stat.S_ISREG(os.fstat(handle).st_mode):
            try:
                lock_file(handle)
            except OSError:
                raise RigtwinError(
                    f"{path} is being written by another program; name another output"
                ) from None
            os.ftruncate(handle, 0)
        # Unbuffered, so that a block is with the system when the call returns, and survives this
        # process.
        return os.fdopen(handle, "wb", buffering=0)
    except BaseException:
        os.close(handle)
        raise
