"""Results on disk by key, where each is written completely or not at all."""

from __future__ import annotations

import base64
import io
import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep.digest import source_digest


def _encode(value: object) -> object:
    """Encode arrays, which JSON lacks, bit for bit as base64 text."""
    if isinstance(value, np.ndarray):
        stream = io.BytesIO()
        np.save(stream, value, allow_pickle=False)
        # numpy's own format preserves every bit; decimal text would not guarantee it.
        return {"array": base64.b64encode(stream.getvalue()).decode()}
    if isinstance(value, np.generic):
        return value.item()
    expected = "expected numbers, text, arrays, lists and tables of them"
    raise TypeError(f"a result holds {type(value).__name__}; {expected}")


def _decode(table: dict[str, Any]) -> object:
    """Decode arrays; the inverse of `_encode`."""
    if table.keys() == {"array"}:
        return np.load(io.BytesIO(base64.b64decode(table["array"])), allow_pickle=False)
    return table


class Store:
    """Results in a SQLite file, for one program at a time.

    Results of other sources than this version's are deleted on opening.

    Parameters
    ----------
    path : Path
        Path of the file. Its folder is created.
    context : str, optional
        Digest of what all results depend on. Defaults to the digest of the sources.

    Raises
    ------
    RigtwinError
        If the file cannot be used, or another program uses it.
    """

    def __init__(self, path: Path, context: str | None = None) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Autocommit: each result is a transaction of its own.
            self._base = sqlite3.connect(path, isolation_level=None, timeout=0.2)
            # Exclusive from here on. A write-ahead log survives a killed program, and needs no
            # flush to disk at each result.
            for line in ("locking_mode=EXCLUSIVE", "journal_mode=WAL", "synchronous=NORMAL"):
                self._base.execute(f"PRAGMA {line}")
            columns = "context TEXT, key TEXT, result TEXT, PRIMARY KEY (context, key)"
            self._base.execute(f"CREATE TABLE IF NOT EXISTS results ({columns})")
            # Results of other sources would be wrong for this version, so they are dropped.
            self._context = source_digest() if context is None else context
            self._base.execute("DELETE FROM results WHERE context <> ?", (self._context,))
        except OSError as error:
            raise RigtwinError(f"cannot make {path.parent}: {error.strerror}") from None
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def _fault(self, error: sqlite3.DatabaseError) -> RigtwinError:
        """Return the error to raise for an error of SQLite."""
        if "locked" in str(error):
            advice = "wait for it, or name another folder"
            return RigtwinError(f"{self.path} is in use by another run; {advice}")
        if "not a database" in str(error) or "malformed" in str(error):
            advice = "remove it and run again"
            return RigtwinError(f"{self.path} is not a file of results, or damaged; {advice}")
        return RigtwinError(f"cannot use {self.path}: {error}")

    def __contains__(self, key: str) -> bool:
        query = "SELECT 1 FROM results WHERE context = ? AND key = ?"
        return bool(self._rows(query, self._context, key))

    def _rows(self, query: str, *values: str) -> list[Any]:
        try:
            return self._base.execute(query, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def __getitem__(self, key: str) -> Any:
        """Return the result of a key. Raise KeyError if there is none."""
        query = "SELECT result FROM results WHERE context = ? AND key = ?"
        rows = self._rows(query, self._context, key)
        if not rows:
            raise KeyError(key)
        try:
            return json.loads(rows[0][0], object_hook=_decode)
        except (ValueError, EOFError):
            raise self._fault(sqlite3.DatabaseError("malformed")) from None

    def __setitem__(self, key: str, result: object) -> None:
        """Store a result. Raise RigtwinError if it cannot be written, as on a full disk."""
        try:
            values = (self._context, key, json.dumps(result, default=_encode))
            self._base.execute("INSERT OR REPLACE INTO results VALUES (?, ?, ?)", values)
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def keys(self) -> Iterator[str]:
        """Yield the keys of all results in alphabetical order."""
        query = "SELECT key FROM results WHERE context = ? ORDER BY key"
        for (key,) in self._rows(query, self._context):
            yield key

    def __len__(self) -> int:
        query = "SELECT COUNT(*) FROM results WHERE context = ?"
        return int(self._rows(query, self._context)[0][0])

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
