"""Selection: the columns and the episodes that an import needs of a file."""

from __future__ import annotations

from dataclasses import dataclass, field

from rigtwin.importing.naming import split_unit


@dataclass(frozen=True)
class Selection:
    """Columns and episodes to read.

    Parameters
    ----------
    names
        Columns that are needed, as a map writes them; None for every column.
    time
        Columns that hold the time, a subset of `names`.
    episodes
        Numbers of the episodes that are needed; empty for every episode.
    """

    names: frozenset[str] | None = None
    time: tuple[str, ...] = ()
    episodes: tuple[int, ...] = ()
    _bare: frozenset[str] = field(init=False, default=frozenset(), repr=False)

    def __post_init__(self) -> None:
        # A map may name a column as the file's first line does, with the unit behind the name.
        names = self.names or ()
        # The dataclass is frozen, and this field derives from the others.
        object.__setattr__(self, "_bare", frozenset(split_unit(name, "")[0] for name in names))

    def takes(self, name: str) -> bool:
        """Return whether a column is needed."""
        return self.names is None or name in self.names or name in self._bare

    def takes_within(self, name: str) -> bool:
        """Return whether a column is needed, or a part of it: `name.field`, `name[0]`, `name:1`."""
        if self.takes(name) or self.names is None:
            return True
        return any(asked.startswith((f"{name}.", f"{name}[", f"{name}:")) for asked in self.names)

    def of_file(self, stem: str) -> Selection:
        """Return the selection for one of several files, whose columns a map may call
        `stem.name`."""
        if self.names is None:
            return self
        inner = {name.removeprefix(f"{stem}.") for name in self.names}
        time = tuple(name.removeprefix(f"{stem}.") for name in self.time)
        return Selection(self.names | inner, time, self.episodes)


EVERYTHING = Selection()
"""Every column of every episode."""
