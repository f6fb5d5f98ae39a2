"""What every rig can do, be it the twin or the real one behind a DAQ."""

from __future__ import annotations

from typing import Any, Protocol

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


class DrivenRig(Protocol):
    """A machine that is led into a test and out of it, as a real one must be: its actuators also
    have power, and it may be late. Samples and commands are those of its `Signals`.

    missed: ticks that passed unread before the last `read`.
    """

    missed: int

    def start(self) -> None:
        """Makes it ready; nothing moves."""
        ...

    def read(self) -> tuple[float, ...]:
        """Samples all sensors; waits for the next tick if it has a clock."""
        ...

    def write(self, commands: Any) -> None:
        """Sets the outputs, which hold until the next write."""
        ...

    def power(self, on: bool) -> None:
        """Lets the actuators have power, such as hydraulics their pressure, or takes it off."""
        ...

    def stop(self) -> None:
        """Forces to zero, power off."""
        ...
