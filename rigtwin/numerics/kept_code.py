"""Compiled code as it lies on the disk: whole, or not used.

numba believes whatever stands in its cache. A full disk, a pulled plug or a bad sector leave files
there that are cut, empty or garbled, and machine code that is garbled does anything. So each file
ends with a digest of what stands before it.
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


class KeptCode(FunctionCache):
    """numba's cache of one function. Where it cannot be written, the code is not kept, and the log
    says so."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        of = self._cache_file
        self._cache_file: _WholeFiles = _WholeFiles.like(of)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except OSError as error:
            self._complain(error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
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


class _WholeFiles(IndexDataCacheFile):
    """The files of one function, an index and one for each signature."""

    @classmethod
    def like(cls, other: IndexDataCacheFile) -> _WholeFiles:
        made = cls.__new__(cls)
        made.__dict__.update(other.__dict__)
        return made

    def _load_index(self) -> Any:
        path = Path(self._index_path)
        if path.exists() and not _is_whole(path):
            # What the index said of the others is lost with it.
            stem = path.name.removesuffix(".nbi")
            for each in [path, *path.parent.glob("*.nbc")]:
                if each.name.startswith(f"{stem}."):
                    each.unlink(missing_ok=True)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not _is_whole(path):
            path.unlink(missing_ok=True)
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
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
    data = path.read_bytes()
    return hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]
