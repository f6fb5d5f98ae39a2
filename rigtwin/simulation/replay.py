"""A recording as a rig: reads what was measured, keeps what the controller would have commanded."""

from __future__ import annotations

from controllers import Commands, Measurements
from rigtwin.recording import Recording


class Replay:
    """Plays a recording's measurements to a controller. `written` collects its commands, one a
    tick."""

    def __init__(self, recording: Recording) -> None:
        """Raises RigtwinError if a sensor is missing."""
        columns = [recording.column("/sensor", name).tolist() for name in Measurements._fields]
        self._rows = [Measurements(*row) for row in zip(*columns, strict=True)]
        self.written: list[Commands] = []

    def start(self) -> None:
        self.written.clear()

    def read(self) -> Measurements:
        return self._rows[len(self.written)]

    def write(self, commands: Commands) -> None:
        self.written.append(commands)

    def stop(self) -> None:
        """Nothing moves."""
