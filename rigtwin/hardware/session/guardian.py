"""The loop's side of a second process that keeps the recording and guards the rig.

If the loop dies or hangs, the guardian stops the rig and says so in the recording.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Sequence

from rigtwin.errors import RigtwinError
from rigtwin.hardware.session.guardian_process import guard
from rigtwin.hardware.session.guardian_settings import (
    ALIVE,
    BEAT,
    GUARDED,
    PREPARED,
    READ,
    RING,
    SAFE,
    WRITTEN,
    GuardianSettings,
    memory_size,
    split_memory,
)
from rigtwin.hardware.supervisor import Transition
from rigtwin.interruptions import block_sigint
from rigtwin.system import monotonic

STARTED = 30.0
"""s within which the guardian must be there."""
ABSENT = 1.0
"""s after which a guardian that does not look any more is missed."""


class Guardian:
    """The loop's side: a `Recorder` of a session whose work another process does."""

    def __init__(self, settings: GuardianSettings) -> None:
        """Raises RigtwinError if the recording cannot be written or the process does not come."""
        self._settings, self._finishing = settings, False
        self.fault: str | None = None
        context = multiprocessing.get_context("spawn")
        layout = settings.layout
        memory = context.RawArray("d", memory_size(layout))
        self._shared, self._ring = split_memory(memory, layout)
        self._pipe, theirs = context.Pipe()
        arguments = (settings, theirs, memory, os.getpid())
        self._process = context.Process(target=guard, args=arguments, name="rigtwin guardian")
        try:
            with block_sigint():
                self._process.start()
            theirs.close()
            if not self._pipe.poll(STARTED):
                raise RigtwinError("the guardian process does not start")
            said = self._answer()
            if said != "ready":
                raise RigtwinError(said or "the guardian process ended before the session began")
        except BaseException:
            self._release()
            raise
        threading.Thread(target=self._listen, daemon=True).start()

    def beat(self, outputs: Sequence[float]) -> None:
        """Tells that the loop is alive, and which outputs are safe; sees whether the guardian
        is."""
        shared, now = self._shared, monotonic()
        shared[SAFE:], shared[BEAT] = outputs, now
        if now - shared[ALIVE] > ABSENT:
            self.fault = self.fault or "the guardian process does not answer any more"

    def tick(self, row: tuple[float, ...]) -> None:
        """Hands over one tick; see `Recorder`."""
        written = int(self._shared[WRITTEN])
        if written - self._shared[READ] >= RING:
            self.fault = self.fault or "the recording cannot keep up with the loop"
            return
        self._ring[written % RING] = row
        self._shared[WRITTEN] = written + 1.0

    def flush(self) -> None:
        """The other process writes by itself."""

    def ready(self) -> None:
        """Waits until the guardian could stop the rig. Raises RigtwinError if it cannot."""
        self._send("prepare")
        end = monotonic() + STARTED
        while self._shared[PREPARED] == 0.0 and self.fault is None and monotonic() < end:
            time.sleep(1e-3)
        if self._shared[PREPARED] == 0.0:
            raise RigtwinError(self.fault or "the guardian process does not answer")

    def transition(self, transition: Transition) -> None:
        """Has a transition recorded; the loop is guarded from arming to rest."""
        if transition.after in self._settings.phases and self._shared[GUARDED] == 0.0:
            self._shared[BEAT] = monotonic()
            self._shared[GUARDED] = 1.0
        self._send("transition", transition)
        if transition.after not in self._settings.phases:
            self._shared[GUARDED] = 0.0

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Has a metadata record added."""
        self._send("metadata", name, values)

    def finish(self, reason: str) -> None:
        """Ends the recording and the other process."""
        self._shared[GUARDED], self._finishing = 0.0, True
        self._send("finish", reason)
        self._process.join(STARTED if self.fault is None else ABSENT)
        self._release()

    def _send(self, *message: object) -> None:
        try:
            self._pipe.send(message)
        except (OSError, ValueError):
            self.fault = self.fault or "the guardian process is gone, and the recording with it"

    def _answer(self) -> object:
        try:
            return self._pipe.recv()
        except (EOFError, OSError):
            return None

    def _listen(self) -> None:
        while (said := self._answer()) is not None:
            self.fault = str(said)
        if self.fault is None and not self._finishing:
            self.fault = "the guardian process is gone, and the recording with it"

    def _release(self) -> None:
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
