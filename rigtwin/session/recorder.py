"""Keeps a session in a recording, in the process that runs it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rigtwin.arrays import Array
from rigtwin.errors import RigtwinError
from rigtwin.recording import Writer
from rigtwin.recording.schema import TRANSITION_RECORD
from rigtwin.supervisor import Transition

SESSION = "/session"


class Keeper:
    """A `rigtwin.supervised.Recorder` that writes at once. What cannot be written is no exception but a `fault`: the rig has to
    be stopped first."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self.fault: str | None = None

    def ticks(self, at: NDArray[np.int64], commands: Array, measured: Array) -> None:
        if self.fault is None:
            self._try(lambda: self._writer.append_at(at, {"command": commands, "sensor": measured}))

    def session(self, rows: Array) -> None:
        if self.fault is None:
            self._try(lambda: self._writer.append_beside(SESSION, rows, rows[:, 0]))

    def transition(self, transition: Transition) -> None:
        """Also when nothing else can be written any more: the writer has kept room for it."""
        self._try(lambda: self._writer.add_metadata(TRANSITION_RECORD, transition.record()))

    def beat(self, ground: float, structure: float) -> None:
        """Nobody watches this process."""

    def _try(self, write: Callable[[], None]) -> None:
        try:
            write()
        except RigtwinError as error:
            self.fault = self.fault or str(error)
