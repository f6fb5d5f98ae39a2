"""Where a log comes from: files whose columns are joined, or a table in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

IN_MEMORY = "data"
"""Name of a table in memory."""


@dataclass(frozen=True)
class LogSource:
    """Source of one log.

    Attributes
    ----------
    files
        Files of the log; empty for a table in memory.
    table
        pandas DataFrame, Arrow table, numpy array with named fields, or mapping name → array; None
        for files. See `read_frame`.
    identity
        Number that tells tables in memory apart; 0 for files.
    """

    files: tuple[Path, ...] = ()
    table: Any = field(default=None, compare=False, repr=False)
    identity: int = 0

    @classmethod
    def of_table(cls, table: object) -> LogSource:
        """Return the source of a table in memory."""
        # The source keeps the table alive, so that no other object can get its number.
        return cls((), table, id(table))

    @property
    def content(self) -> Sequence[Path] | Any:
        """The files, or the table, as `read_columns` takes them."""
        return self.files or self.table

    @property
    def label(self) -> str:
        """Names of the files for messages, or that of a table in memory."""
        return " + ".join(path.name for path in self.files) or IN_MEMORY

    @property
    def path(self) -> Path:
        """The first file, or a name in the place of one."""
        return self.files[0] if self.files else Path(IN_MEMORY)

    @property
    def title(self) -> str:
        """Names of the files without their endings."""
        return " ".join(path.stem for path in self.files) or IN_MEMORY
