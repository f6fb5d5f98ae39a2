"""Results on disk, key → result, each there as a whole or not at all, whatever kills the program."""

from __future__ import annotations

import base64
import io
import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep.digest import source_digest


def _encoded(value: object) -> object:
    """Of arrays, which JSON does not have; bit for bit."""
    if isinstance(value, np.ndarray):
        stream = io.BytesIO()
        np.save(stream, value, allow_pickle=False)
        return {"array": base64.b64encode(stream.getvalue()).decode()}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a result holds {type(value).__name__}; expected numbers, text, arrays, lists and tables of them")


def _decoded(table: dict[str, Any]) -> object:
    if table.keys() == {"array"}:
        return np.load(io.BytesIO(base64.b64decode(table["array"])), allow_pickle=False)
    return table


class Store:
    """Results of this version's sources in a SQLite file; those of other sources are dropped. Used by one program at a time."""

    def __init__(self, path: Path, context: str | None = None) -> None:
        """context: what all results depend on, by default the sources. Raises RigtwinError if the file cannot be used."""
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._base = sqlite3.connect(path, isolation_level=None, timeout=0.2)
            # Exclusive from here on; a write ahead log survives being killed and needs no flush at each result.
            for line in ("locking_mode=EXCLUSIVE", "journal_mode=WAL", "synchronous=NORMAL"):
                self._base.execute(f"PRAGMA {line}")
            self._base.execute(
                "CREATE TABLE IF NOT EXISTS results (context TEXT, key TEXT, result TEXT, PRIMARY KEY (context, key))"
            )
            self._context = source_digest() if context is None else context
            self._base.execute("DELETE FROM results WHERE context <> ?", (self._context,))
        except OSError as error:
            raise RigtwinError(f"cannot make {path.parent}: {error.strerror}") from None
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def _fault(self, error: sqlite3.DatabaseError) -> RigtwinError:
        if "locked" in str(error):
            return RigtwinError(f"{self.path} is in use by another run; wait for it, or name another folder")
        if "not a database" in str(error) or "malformed" in str(error):
            return RigtwinError(f"{self.path} is not a file of results, or damaged; remove it and run again")
        return RigtwinError(f"cannot use {self.path}: {error}")

    def __contains__(self, key: str) -> bool:
        return bool(self._rows("SELECT 1 FROM results WHERE context = ? AND key = ?", self._context, key))

    def _rows(self, query: str, *values: str) -> list[Any]:
        try:
            return self._base.execute(query, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def __getitem__(self, key: str) -> Any:
        """The result of that key. Raises KeyError if there is none."""
        rows = self._rows("SELECT result FROM results WHERE context = ? AND key = ?", self._context, key)
        if not rows:
            raise KeyError(key)
        try:
            return json.loads(rows[0][0], object_hook=_decoded)
        except (ValueError, EOFError):
            raise self._fault(sqlite3.DatabaseError("malformed")) from None

    def __setitem__(self, key: str, result: object) -> None:
        """Raises RigtwinError if it cannot be written, such as on a full disk."""
        try:
            self._base.execute(
                "INSERT OR REPLACE INTO results VALUES (?, ?, ?)", (self._context, key, json.dumps(result, default=_encoded))
            )
        except sqlite3.DatabaseError as error:
            raise self._fault(error) from None

    def keys(self) -> Iterator[str]:
        for (key,) in self._rows("SELECT key FROM results WHERE context = ? ORDER BY key", self._context):
            yield key

    def __len__(self) -> int:
        return int(self._rows("SELECT COUNT(*) FROM results WHERE context = ?", self._context)[0][0])

    def close(self) -> None:
        self._base.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()
