"""A twin beside a test that is running."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from rigtwin.api.machines import Settings, described_machine, twin_of
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording.growing import GrowingRecording
from rigtwin.watching import Alarm, Suspect, Watch
from rigtwin.watching.watch import SHORTEST, STEP, WARM, WINDOW

__all__ = ["Alarm", "Suspect", "Watch", "watch"]

PATIENCE = 30.0
"""s without anything new after which a recording without an end is given up; a session in real time
takes some to begin."""
LOOK = 0.05
"""s from one look at the file to the next."""


def watch(
    path: str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    told: Callable[[Watch], object] = lambda _: None,
    suspects: bool = True,
    step: float = STEP,
    patience: float = PATIENCE,
    stop: Callable[[], bool] = lambda: False,
) -> Watch:
    """Holds a recording against its twin while it is written, until its test ends; or, of one that
    is whole, as fast as it goes.

    Parameters
    ----------
    path
        Of the recording, an MCAP file that another program writes or is about to.
    machine
        That it is of; by default the one that it names.
    settings
        Changes of the twin that it is compared with: of its plant and `timing.timestep`.
    without
        Effects that are taken out of the twin first, such as "coulomb@rail".
    told
        Called whenever there is something new: a stretch that was judged, or suspects.
    suspects
        Whether to look for what may be behind an alarm.
    step
        s of the test that are judged at a time, or more where judging takes longer.
    patience
        s without anything new after which the recording is given up.
    stop
        Asked from time to time; the watch ends where it says so.

    Returns
    -------
    Watch
        As it ended; its `alarm` is None if there was no gap beyond noise and tolerances.

    Raises
    ------
    RigtwinError
        If the file cannot be read, is of another machine, lacks a channel, nothing of it could be
        judged, or nothing was added to it for longer than `patience` before its test ended.
    """
    if not STEP <= step <= WINDOW - WARM:
        raise RigtwinError(f"steps of {step:g} s; expected {STEP:g} to {WINDOW - WARM:g} s")
    if not patience > 0.0:
        raise RigtwinError(f"a patience of {patience:g} s; expected more than 0 s")
    growing = GrowingRecording(Path(path), WINDOW + step)
    watching, looked = None, time.monotonic()
    while not stop():
        here = time.monotonic()
        if not growing.path.exists() and here - looked <= patience:
            time.sleep(LOOK)
            continue
        # Where judging takes longer than the test, longer stretches are judged at a time.
        grew = growing.read(growing.latest + max(step, here - looked))
        if not grew and not growing.ended:
            if here - looked > patience:
                raise RigtwinError(
                    f"{path}: nothing was added to it for {patience:g} s, and it does not say that "
                    "its test is over"
                )
            time.sleep(LOOK)
            continue
        looked = here
        recording = growing.recording()
        if watching is None:
            found = described_machine(recording, machine)
            watching = Watch(found, twin_of(found, settings, without))
        if watching.take(recording, last=growing.ended):
            told(watching)
        if suspects and watching.investigate(recording, last=growing.ended):
            told(watching)
        if growing.ended:
            break
    if watching is None or watching.gap is None:
        why = watching.note if watching is not None else ""
        raise RigtwinError(why or f"{path}: a test is judged from {SHORTEST:g} s on")
    return watching
