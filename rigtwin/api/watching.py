"""A running test compared with its twin."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from rigtwin.api.machines import described_machine
from rigtwin.api.twin import Settings, twin_of
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader
from rigtwin.recording.growing import GrowingRecording
from rigtwin.watching import Alarm, Suspect, Watch
from rigtwin.watching.watch import SHORTEST, STEP, WARM, WINDOW

__all__ = ["Alarm", "Suspect", "Watch", "watch"]

PATIENCE = 30.0
"""Time without new data after which an unfinished recording is given up, in s. A session in real
time takes several seconds to begin."""
POLL = 0.05
"""Time between two looks at the file, in s."""


def watch(
    path: str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    on_update: Callable[[Watch], object] = lambda _: None,
    suspects: bool = True,
    step: float = STEP,
    patience: float = PATIENCE,
    stop: Callable[[], bool] = lambda: False,
) -> Watch:
    """Compare a recording with its twin while it is being written, until its test ends.

    A finished recording is compared as fast as the computer allows. The alarm is a CUSUM of every
    sensor's residual in each frequency band.

    Parameters
    ----------
    path
        File of the recording, MCAP, which another program is writing or will write.
    machine
        Machine the recording belongs to, or its name, or the path of its description. Defaults to
        the one named in the recording.
    settings
        Changes of the twin before the comparison: of its plant and `timing.timestep`. All other
        settings are the recording's own.
    without
        Effects of the nominal machine that are removed from the twin first, such as
        "coulomb@rail".
    on_update
        Function called with the `Watch` after each judged interval and each search for suspects.
    suspects
        Whether to search for effects that may cause an alarm. Defaults to True.
    step
        Length of the interval that is judged at a time, in s, 0.5 by default. It grows where the
        comparison takes longer than the test.
    patience
        Time without new data after which the recording is given up, in s, 30 by default.
    stop
        Function called between two looks at the file; the watch ends when it returns True.

    Returns
    -------
    Watch
        Watch at its end. `alarm` is None, or states sensor, time and suspects; `level` and
        `highest` are the present and the highest CUSUM, where 1 raises an alarm; `seconds` is the
        time that could be judged.

    Raises
    ------
    RigtwinError
        If the file cannot be read or judged, or nothing is added to it for longer than `patience`.

    Examples
    --------
    >>> watch = rigtwin.watch("test.mcap", on_update=lambda now: print(now.level))  # doctest: +SKIP
    >>> print(watch.alarm)  # doctest: +SKIP
    """
    watching = None
    for recording, ended in _read_intervals(Path(path), step, patience, stop):
        watching = watching or _start_watch(recording, machine, settings, without)
        if watching.take(recording, last=ended):
            on_update(watching)
        if suspects and watching.investigate(recording, last=ended):
            on_update(watching)
    if watching is None or watching.gap is None:
        why = watching.note if watching is not None else ""
        raise RigtwinError(why or f"{path}: a test is judged from {SHORTEST:g} s on")
    return watching


def _start_watch(
    recording: reader.RecordedTest,
    machine: Machine | str | Path | None,
    settings: Settings,
    without: Sequence[str],
) -> Watch:
    """Return a watch of the machine whose first interval was recorded."""
    described = described_machine(recording, machine)
    return Watch(described, twin_of(described, settings, without))


def _read_intervals(
    path: Path, step: float, patience: float, stop: Callable[[], bool]
) -> Iterator[tuple[reader.RecordedTest, bool]]:
    """Yield the window of a growing recording after each interval, and whether its test ended."""
    if not STEP <= step <= WINDOW - WARM:
        raise RigtwinError(f"step {step:g} s: expected {STEP:g} to {WINDOW - WARM:g} s")
    if not patience > 0.0:
        raise RigtwinError(f"patience {patience:g} s: expected more than 0 s")
    # Longer by a step, so that the window is complete after each read.
    growing = GrowingRecording(path, WINDOW + step)
    last_new = time.monotonic()
    while not (growing.ended or stop()):
        now = time.monotonic()
        # The recording may be awaited before its test has begun.
        if not growing.path.exists() and now - last_new <= patience:
            time.sleep(POLL)
            continue
        # If judging takes longer than the interval itself, the interval grows, so that the watch
        # keeps pace with the test.
        grew = growing.read(growing.latest + max(step, now - last_new))
        if not grew and not growing.ended:
            if now - last_new > patience:
                raise RigtwinError(
                    f"{path}: nothing was added to it for {patience:g} s, and it does not say that "
                    "its test is over"
                )
            time.sleep(POLL)
            continue
        last_new = now
        yield growing.recording(), growing.ended
