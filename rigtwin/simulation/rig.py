"""What every rig can do, be it the twin or the real one behind a DAQ."""

from __future__ import annotations

from typing import Protocol

from controllers import Commands, Measurements


class Rig(Protocol):
    """Four verbs. The loop calls `start`, then `read` and `write` once a tick, then `stop`, also
    after a fault."""

    def start(self) -> None:
        """Makes the rig ready at its start position."""
        ...

    def read(self) -> Measurements:
        """Samples all sensors; waits for the next tick if the rig has a clock."""
        ...

    def write(self, commands: Commands) -> None:
        """Sets the outputs, which hold until the next write."""
        ...

    def stop(self) -> None:
        """Brings the rig to rest."""
        ...


class DrivenRig(Rig, Protocol):
    """A rig that is ramped in and out, as the real one must be: it also has hydraulic pressure, and
    may be late.

    missed: ticks that passed unread before the last `read`.
    """

    missed: int

    def pressure(self, on: bool) -> None:
        """Lets the hydraulics have pressure, or takes it off."""
        ...
