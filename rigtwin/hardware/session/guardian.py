"""Client of the guardian: a second process that writes the recording and guards the rig.

If the loop dies or hangs, the guardian stops the rig and notes the cause in the recording.
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
"""Time within which the guardian must start, in s."""
ABSENT = 1.0
"""Time without a sign of life after which the guardian counts as lost, in s."""


class Guardian:
    """`Recorder` of a session that leaves the work to another process."""

    def __init__(self, settings: GuardianSettings) -> None:
        """Start the guardian.

        Raises
        ------
        RigtwinError
            If the recording cannot be written, or the process does not start.
        """
        self._settings, self._finishing = settings, False
        self.fault: str | None = None
        # A forked guardian would inherit the loop's gRPC threads and locks in an unknown state.
        context = multiprocessing.get_context("spawn")
        layout = settings.layout
        memory = context.RawArray("d", memory_size(layout))
        self._shared, self._ring = split_memory(memory, layout)
        # Rare messages use the pipe; ticks use shared memory, which costs no system call.
        self._pipe, theirs = context.Pipe()
        arguments = (settings, theirs, memory, os.getpid())
        self._process = context.Process(target=guard, args=arguments, name="rigtwin guardian")
        try:
            # Ctrl-C reaches every process of a terminal; the guardian must outlive it.
            with block_sigint():
                self._process.start()
            # Without our copy of the guardian's end, its death shows as an end of file on ours.
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
        """Show that the loop is alive, note which outputs are safe, and check the guardian."""
        shared, now = self._shared, monotonic()
        # The safe outputs are written before the time, so that they are valid once the time is new.
        shared[SAFE:], shared[BEAT] = outputs, now
        if now - shared[ALIVE] > ABSENT:
            self.fault = self.fault or "the guardian process does not answer any more"

    def tick(self, row: tuple[float, ...]) -> None:
        """Hand over one tick; see `Recorder`."""
        written = int(self._shared[WRITTEN])
        if written - self._shared[READ] >= RING:
            # The ring is full. Waiting would stop the loop, overwriting would lose ticks.
            self.fault = self.fault or "the recording cannot keep up with the loop"
            return
        self._ring[written % RING] = row
        # The counter is raised after the row is complete: the reader never sees half a row.
        self._shared[WRITTEN] = written + 1.0

    def flush(self) -> None:
        """Do nothing: the guardian writes continuously."""

    def ready(self) -> None:
        """Wait until the guardian is able to stop the rig. Raise RigtwinError if it is not."""
        # The guardian attaches to the card's outputs. That is slow, and requires the loop's tasks.
        self._send("prepare")
        # The flag is polled: the guardian sets it in shared memory.
        end = monotonic() + STARTED
        while self._shared[PREPARED] == 0.0 and self.fault is None and monotonic() < end:
            time.sleep(1e-3)
        if self._shared[PREPARED] == 0.0:
            raise RigtwinError(self.fault or "the guardian process does not answer")

    def transition(self, transition: Transition) -> None:
        """Record a transition; guard the loop from arming to rest."""
        if transition.after in self._settings.phases and self._shared[GUARDED] == 0.0:
            # A fresh beat first: the last one may be older than the guardian tolerates.
            self._shared[BEAT] = monotonic()
            self._shared[GUARDED] = 1.0
        self._send("transition", transition)
        # The transition is sent first: the guardian must know that the rig is at rest before
        # guarding ends.
        if transition.after not in self._settings.phases:
            self._shared[GUARDED] = 0.0

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Add a metadata record."""
        self._send("metadata", name, values)

    def finish(self, reason: str) -> None:
        """End the recording and the guardian."""
        self._shared[GUARDED], self._finishing = 0.0, True
        self._send("finish", reason)
        # A guardian that has failed may never end by itself, so it is given less time.
        self._process.join(STARTED if self.fault is None else ABSENT)
        self._release()

    def _send(self, *message: object) -> None:
        try:
            self._pipe.send(message)
        except (OSError, ValueError):
            self.fault = self.fault or "the guardian process is gone; nothing is recorded any more"

    def _answer(self) -> object:
        """Return the guardian's next message; None after its end."""
        try:
            return self._pipe.recv()
        except (EOFError, OSError):
            return None

    def _listen(self) -> None:
        """Take every message of the guardian as a fault, until it ends."""
        while (said := self._answer()) is not None:
            self.fault = str(said)
        if self.fault is None and not self._finishing:
            self.fault = "the guardian process is gone; nothing is recorded any more"

    def _release(self) -> None:
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
