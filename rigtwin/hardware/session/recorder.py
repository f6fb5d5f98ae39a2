"""Keeps a session in a recording, in the process that runs it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controllers import Commands, Measurements
from rigtwin.errors import RigtwinError
from rigtwin.hardware.supervisor import Transition
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.recording.channels import topic_fields
from rigtwin.recording.schema import TRANSITION_RECORD
from rigtwin.simulation.loop import BLOCK

SESSION = "/session"
FIELDS = topic_fields(SESSION)
SENSORS = [FIELDS.index(name) for name in Measurements._fields]
COMMANDS = slice(len(FIELDS), len(FIELDS) + len(Commands._fields))
NUMBER = len(FIELDS) + len(Commands._fields)
ROW = NUMBER + 1
"""Numbers of a tick as a `rigtwin.hardware.supervision.Recorder` gets them: /session, /command,
the tick's number in the test."""


class Keeper:
    """A `rigtwin.hardware.supervision.Recorder` that writes block by block.

    What cannot be written is no exception but a `fault`: the rig has to be stopped first.
    """

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self.fault: str | None = None
        self._rows, self._kept = np.empty((BLOCK, ROW)), 0

    def tick(self, row: tuple[float, ...]) -> None:
        self._rows[self._kept] = row
        self._kept += 1
        if self._kept == BLOCK:
            self.flush()

    def flush(self) -> None:
        rows = self._rows[: self._kept]
        self._kept = 0
        self.block(rows)

    def block(self, rows: Array) -> None:
        """Consecutive ticks, shape (ticks, ROW)."""
        if self.fault is not None or not len(rows):
            return
        tested = rows[np.isfinite(rows[:, NUMBER])]
        if len(tested):
            topics = {"command": tested[:, COMMANDS], "sensor": tested[:, SENSORS]}
            self._try(lambda: self._writer.append_at(tested[:, NUMBER].astype(np.int64), topics))
        session = np.ascontiguousarray(rows[:, : len(FIELDS)])
        self._try(lambda: self._writer.append_beside(SESSION, session, session[:, 0]))

    def transition(self, transition: Transition) -> None:
        """Also when nothing else can be written any more: the writer has kept room for it."""
        self._try(lambda: self._writer.add_metadata(TRANSITION_RECORD, transition.record()))

    def ready(self) -> None:
        """It is, since the writer is there."""

    def beat(self, ground: float, structure: float) -> None:
        """Nobody watches this process."""

    def _try(self, write: Callable[[], None]) -> None:
        try:
            write()
        except RigtwinError as error:
            self.fault = self.fault or str(error)
