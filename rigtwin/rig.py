"""What every rig can do, be it the twin, a recording, or the real one behind a DAQ."""

from __future__ import annotations

from typing import Protocol

from controllers import Commands, Measurements


class Rig(Protocol):
    """Four verbs. The loop calls `start`, then `read` and `write` once a tick, then `stop`, also after a fault."""

    def start(self) -> None:
        """Makes the rig ready at its start position."""
        ...

    def read(self) -> Measurements:
        """Samples all sensors now."""
        ...

    def write(self, commands: Commands) -> None:
        """Sets the outputs, which hold until the next write; returns when the next tick is due."""
        ...

    def stop(self) -> None:
        """Brings the rig to rest."""
        ...
