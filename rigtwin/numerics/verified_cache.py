"""Cache of compiled code that verifies every file before use.

numba trusts whatever is in its cache. A full disk, a power failure or a bad sector leaves files
that are truncated, empty or corrupt, and corrupt machine code may do anything. Each file therefore
ends with a digest of its content.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any
from uuid import uuid4

from numba.core.caching import FunctionCache, IndexDataCacheFile

_DIGEST = hashlib.sha256().digest_size


class VerifiedCache(FunctionCache):
    """numba's cache of one function. If it cannot be written, the code is compiled every time, and
    the log says so."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        files = self._cache_file
        self._cache_file: _VerifiedFiles = _VerifiedFiles.like(files)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load compiled code; None if it cannot be read."""
        try:
            return super().load_overload(sig, target_context)
        except OSError as error:
            self._complain(error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save compiled code, if possible."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            self._complain(error)

    def _complain(self, error: OSError) -> None:
        logging.getLogger("rigtwin").warning(
            "rigtwin: compiled code cannot be kept in %s: %s; it is compiled each time",
            self.cache_path,
            error.strerror,
        )


class _VerifiedFiles(IndexDataCacheFile):
    """Files of one function: an index, and one file per signature."""

    @classmethod
    def like(cls, files: IndexDataCacheFile) -> _VerifiedFiles:
        """Return verified files at the same paths as numba's unverified ones."""
        made = cls.__new__(cls)
        made.__dict__.update(files.__dict__)
        return made

    def _load_index(self) -> Any:
        path = Path(self._index_path)
        if path.exists() and not _is_whole(path):
            # Without the index nobody knows what the other files contain, so they go too.
            stem = path.name.removesuffix(".nbi")
            for file in [path, *path.parent.glob("*.nbc")]:
                if file.name.startswith(f"{stem}."):
                    file.unlink(missing_ok=True)
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            # The index names a class of an earlier version of the program.
            return {}

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not _is_whole(path):
            path.unlink(missing_ok=True)
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        # A temporary file is written completely, then renamed: a power failure leaves the old file.
        content = BytesIO()
        yield content
        data = content.getvalue()
        beside = Path(f"{filepath}.{uuid4().hex[:16]}")
        try:
            with beside.open("wb") as file:
                file.write(data + hashlib.sha256(data).digest())
                file.flush()
                os.fsync(file.fileno())
            beside.replace(filepath)
        except BaseException:
            with suppress(OSError):
                beside.unlink()
            raise


def _is_whole(path: Path) -> bool:
    """Return whether a file's digest matches its content."""

    data = path.read_bytes()
    return hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]
