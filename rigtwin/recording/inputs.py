"""Signals that drive a machine's model: those of a recording, or those that a test demands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Inputs:
    """Commands, prescribed motions and readings by channel.

    Attributes
    ----------
    source : str
        Name of the recording or test, for messages.
    period : float
        Time from tick to tick, s.
    columns : mapping
        Topic → field → values, shape (ticks,), SI; all of one length.
    controller : mapping
        Settings of the controller that issued the commands; empty if unknown.
    """

    source: str
    period: float
    columns: Mapping[str, Mapping[str, Array]]
    controller: Mapping[str, object] = field(default_factory=dict)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        # All channels have the same number of ticks, so any of them will do.
        signals = (values for names in self.columns.values() for values in names.values())
        return len(next(signals, ()))

    @property
    def channels(self) -> set[tuple[str, str]]:
        """Topic and field of every channel."""
        return {(topic, name) for topic, names in self.columns.items() for name in names}

    def has(self, topic: str, name: str) -> bool:
        """Return whether a channel exists."""
        return name in self.columns.get(topic, {})

    def column(self, topic: str, name: str) -> Array:
        """Return one channel, shape (ticks,).

        Raises
        ------
        RigtwinError
            If the channel is missing; the message lists those that exist.
        """
        try:
            return self.columns[topic][name]
        except KeyError:
            existing = ", ".join(f"{t}.{n}" for t, names in self.columns.items() for n in names)
            raise RigtwinError(
                f"{self.source}: channel {topic}.{name} is missing; it has {existing or 'none'}"
            ) from None
