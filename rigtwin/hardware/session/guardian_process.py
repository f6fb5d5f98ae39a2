"""Process of the guardian: writes the recording, and stops the rig if the loop dies or hangs."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from rigtwin.errors import RigtwinError
from rigtwin.hardware.realtime import PRIORITY
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
    SharedMemory,
    split_memory,
)
from rigtwin.hardware.session.recorder import SESSION, SessionRecorder
from rigtwin.hardware.supervisor import Cause, Phase, Transition
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.simulation.loop import BLOCK
from rigtwin.system import kill_process, leave_terminal, monotonic, raise_priority, watch_process

if TYPE_CHECKING:
    from rigtwin.hardware.daq.failsafe import FailsafeOutputs

WRITE = 0.1
"""Time between two blocks of the recording, in s."""
LOOK = 2.5e-4
"""Time between two checks of the loop, in s."""
GONE = 1.0
"""Time within which a killed process must be gone, in s."""


def guard(settings: GuardianSettings, pipe: Connection, memory: SharedMemory, owner: int) -> None:
    """Run the guardian until the recording is finished or the rig is stopped.

    Parameters
    ----------
    settings : GuardianSettings
        Settings of the guardian.
    pipe : Connection
        Connection to the loop, for everything but ticks.
    memory : SharedMemory
        Memory through which ticks arrive.
    owner : int
        Process identifier of the loop.
    """
    # Signals of the terminal reach the whole group; only the loop may react to them.
    leave_terminal()
    shared, ring = split_memory(memory, settings.layout)
    try:
        writer = settings.open_writer()
        writer.reserve()
        for name, values in settings.metadata.items():
            writer.add_metadata(name, values)
        view = _open_live_view(settings)
        keeper = _GuardianRecorder(writer, pipe, settings, view, shared=shared, ring=ring)
        keeper.make_ready()
    except RigtwinError as error:
        pipe.send(str(error))
        return
    shared[ALIVE] = monotonic()
    thread = threading.Thread(target=keeper.work, daemon=True)
    thread.start()
    # Only this thread gets priority above the loop. Writing must never delay the loop.
    raise_priority(PRIORITY + 5)
    pipe.send("ready")
    died = _guard_loop(owner, shared, settings, keeper)
    # The rig is made safe first; the recording is finished after that.
    if died is not None:
        keeper.stop_rig(died, shared)
    # The writing thread ends when the pipe closes; a killed process that the system has not yet
    # removed still holds it open.
    thread.join(1.0)
    keeper.finish(died)


def _open_live_view(settings: GuardianSettings) -> Callable[[str, Array], None] | None:
    """Open the live view if the settings name a port."""
    if settings.live == 0:
        return None
    from rigtwin.hardware.session.live import open_live_view

    return open_live_view(settings.live, settings.layout.fields)


def _guard_loop(
    owner: int, shared: Array, settings: GuardianSettings, keeper: _GuardianRecorder
) -> Cause | None:
    """Return None once the recording is finished, or the cause once the loop is dead or silent."""
    with watch_process(owner) as ended:
        while not keeper.done.is_set():
            shared[ALIVE] = monotonic()
            if ended(LOOK):
                return Cause("process", "the controller process died") if shared[GUARDED] else None
            silent = monotonic() - shared[BEAT] > settings.patience
            # A hung loop could wake up and write again, so it is killed before the rig is stopped.
            if settings.table is not None and shared[GUARDED] and silent:
                kill_process(owner)
                if not settings.table.address:
                    # A driver on this computer frees the lines only when the process is gone.
                    ended(GONE)
                waited = f"{1e3 * settings.patience:.3g} ms"
                reason = f"the controller process died or hung: no tick for {waited}; it was killed"
                return Cause("process", reason)
    return None


class _GuardianRecorder:
    """Recorder of what the loop sends, on a thread of its own."""

    def __init__(
        self,
        writer: Writer,
        pipe: Connection,
        settings: GuardianSettings,
        view: Callable[[str, Array], None] | None,
        shared: Array,
        ring: Array,
    ) -> None:
        self._shared, self._ring = shared, ring
        self._writer, self._recorder = writer, SessionRecorder(writer, settings.layout)
        self._pipe, self._settings, self._view = pipe, settings, view
        self._last: Transition | None = None
        self._reason: str | None = None
        self._failsafe: FailsafeOutputs | None = None
        self._cause = Cause("process", "")
        self._time, self._said = 0.0, False
        self.done = threading.Event()

    def work(self) -> None:
        """Write until the loop has finished the recording or is gone."""
        try:
            while self._reason is None:
                if self._pipe.poll(WRITE):
                    kind, *content = self._pipe.recv()
                    # A message's kind names the method that handles it.
                    getattr(self, f"_{kind}")(*content)
                self._drain()
                if self._recorder.fault is not None and not self._said:
                    self._said = True
                    self._pipe.send(self._recorder.fault)
        except (EOFError, OSError):
            self._drain()
        if self._reason is not None:
            self._drain()
            self.done.set()

    def _drain(self) -> None:
        """Write the ticks that the loop has put into shared memory."""
        shared = self._shared
        while (first := int(shared[READ])) < (last := int(shared[WRITTEN])):
            # At most a block, and not beyond the ring's end, where the rows wrap around.
            last = min(last, first + BLOCK, (first // RING + 1) * RING)
            # A copy, because the loop overwrites the ring as soon as READ moves on.
            rows = self._ring[first % RING : first % RING + last - first].copy()
            shared[READ] = float(last)
            self._recorder.block(rows)
            self._time = float(rows[-1, 0])
            if self._view is not None:
                self._view(SESSION, rows[:, : len(self._settings.layout.session)])

    def make_ready(self) -> None:
        """Do everything that takes long before there is anything to guard."""
        if self._settings.table is not None:
            from rigtwin.hardware.daq.failsafe import FailsafeOutputs

            self._failsafe = FailsafeOutputs(self._settings.table)

    def _prepare(self) -> None:
        """Attach to the card's outputs, which the loop has opened by now."""
        if self._failsafe is not None:
            try:
                self._failsafe.prepare()
            except RigtwinError as error:
                self._pipe.send(str(error))
                return
        self._shared[PREPARED] = 1.0

    def _transition(self, transition: Transition) -> None:
        # Ticks before the transition are written first, to keep the recording in order.
        self._last = transition
        self._drain()
        self._recorder.transition(transition)

    def _metadata(self, name: str, values: dict[str, str]) -> None:
        with suppress(RigtwinError):
            self._writer.add_metadata(name, values)

    def _finish(self, reason: str) -> None:
        self._reason = reason

    def stop_rig(self, cause: Cause, shared: Array) -> None:
        """Set safe outputs now, and switch the power off after the hold."""
        said = cause.reason
        failsafe = self._failsafe
        if failsafe is not None:
            # The guardian holds its outputs for the same time as the loop would: first safe, then
            # without power.
            failed = _try_often(lambda: failsafe.hold(shared[SAFE:]))
            if failed is None:
                time.sleep(self._settings.hold)
            failed = _try_often(failsafe.power_off) or failed
            if failed is not None:
                said = f"{said}; and {failed}: stop the rig by hand"
            failsafe.close()
        self._cause = Cause(cause.name, said)
        print(f"rigtwin: {said}", file=sys.stderr, flush=True)

    def finish(self, died: Cause | None) -> None:
        """Close the recording. If the loop died, add the missing transitions."""
        if died is None:
            self._writer.finish(self._reason or "the loop ended without a word")
            return
        before = self._last.after if self._last is not None else Phase.IDLE
        cause = self._cause
        now = self._time if self._last is None else max(self._time, self._last.time)
        # A recording's transitions must follow the permitted ways, also after a crash.
        if before != Phase.STOPPING:
            self._recorder.transition(Transition(now, before, Phase.STOPPING, cause))
        self._recorder.transition(Transition(now, Phase.STOPPING, Phase.FAULTED, cause))
        with suppress(RigtwinError):
            self._writer.finish(cause.reason)


def _try_often(act: Callable[[], None]) -> str | None:
    """Call a function until it succeeds. Return its last error, or None."""
    failed = None
    for _ in range(TRIES):
        try:
            act()
        except RigtwinError as error:
            failed = str(error)
            time.sleep(0.02)
        else:
            return None
    return failed


TRIES = 25
"""Number of attempts at a call that has to succeed, over half a second."""
