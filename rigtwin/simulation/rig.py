"""Protocols of a rig, implemented by the twin, a replay and the real rig behind its card."""

from __future__ import annotations

from typing import Any, Protocol

from controllers import Commands, Measurements


class Rig(Protocol):
    """Protocol of a rig that runs a test.

    The loop calls `start`, then `read` and `write` once per tick, then `stop`, also after a fault.
    """

    def start(self) -> None:
        """Make the rig ready at its start position."""
        ...

    def read(self) -> Measurements:
        """Sample all sensors, after waiting for the next tick if the rig has a clock."""
        ...

    def write(self, commands: Commands) -> None:
        """Sets the outputs, which hold until the next write."""
        ...

    def stop(self) -> None:
        """Bring the rig to rest."""
        ...


class DrivenRig(Protocol):
    """Protocol of a machine that is led into a test and out of it, as a real one must be.

    Its actuators have a power supply, and it may miss ticks. Samples and commands are those of its
    `Signals`.
    """

    missed: int  # Ticks that passed unread before the last `read`.

    def start(self) -> None:
        """Make the machine ready without moving it."""
        ...

    def read(self) -> tuple[float, ...]:
        """Sample all sensors, after waiting for the next tick if the machine has a clock."""
        ...

    def write(self, commands: Any) -> None:
        """Sets the outputs, which hold until the next write."""
        ...

    def power(self, on: bool) -> None:
        """Switch the actuators' power on or off, such as the pressure of hydraulics."""
        ...

    def stop(self) -> None:
        """Set forces to zero and switch the power off."""
        ...
