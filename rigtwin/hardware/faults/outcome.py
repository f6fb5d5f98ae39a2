"""Fault of one session, and the judgement of how the session ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.kinds import SIGNALS, FaultKind
from rigtwin.hardware.session.test import Test
from rigtwin.recording import load
from rigtwin.recording.recorded_test import transitions


@dataclass(frozen=True)
class InjectedFault:
    """Fault of one session.

    Parameters
    ----------
    kind : FaultKind
        Kind of the fault.
    experiment : str
        Name of the experiment.
    at : int
        Tick of the card at which the fault begins.
    place : int
        Index of the faulty input or output.
    seed : int
        Seed of the demands, of the sensors' noise, and of the fault's random numbers.
    """

    kind: FaultKind
    experiment: str
    at: int
    place: int
    seed: int


@dataclass(frozen=True)
class FaultResult:
    """Result of a session with a fault.

    Parameters
    ----------
    fault : InjectedFault
        Fault of the session.
    late : int or None
        Number of ticks from the fault's first visibility to safe outputs. None if it never became
        visible and the test was completed.
    from_start : int
        Number of ticks from the fault to safe outputs.
    exceeded : float
        Largest true position, travel or force, relative to its limit.
    cause, reason : str
        Cause and reason of the end in the recording.
    right : bool
        Whether cause and reason name the fault.
    readable : bool
        Whether the recording can be read up to its last tick.
    """

    fault: InjectedFault
    late: int | None
    from_start: int
    exceeded: float
    cause: str
    reason: str
    right: bool
    readable: bool

    @property
    def ok(self) -> bool:
        """Whether the rig stopped within 5 ticks and 1.1 times every limit, for the true cause."""
        in_time = self.late is None or self.late <= 5
        return in_time and self.exceeded <= 1.1 and self.right and self.readable


def judge(fault: InjectedFault, test: Test, bench: FaultyBench, path: Path) -> FaultResult:
    """Judge a session by the log at its terminals and by its recording.

    Parameters
    ----------
    fault : InjectedFault
        Fault of the session.
    test : Test
        Test of the session.
    bench : FaultyBench
        Terminals with the log.
    path : Path
        Path of the recording.

    Returns
    -------
    FaultResult
        Result, with times in ticks of the card.
    """
    cause, reason = read_final_cause(path)
    safe = bench.find_safe_tick()
    # A fault may never show, such as a stuck valve that nobody asks to move: then the test must
    # have been completed.
    harmless = cause == "completed"
    shown = fault.at if fault.kind.everywhere else bench.shown
    # A fault that never showed and did no harm has no delay.
    late = None if harmless and shown < 0 else safe - (shown if shown >= 0 else safe)
    # A sensor's fault must be blamed on the right sensor, not only on the right cause.
    named = (
        fault.kind.place != "sensor"
        or cause not in ("jump", "stuck", "not_a_number", "motor")
        or SIGNALS[fault.place] in reason
    )
    right = named and (cause in fault.kind.causes or (harmless and shown < 0))
    # Since the fault: before it, a hard test may come near its limits by itself.
    exceeded = bench.peak_share(test.card_configuration.safety, fault.at)
    return FaultResult(
        fault,
        late=late,
        from_start=safe - fault.at,
        exceeded=exceeded,
        cause=cause,
        reason=reason,
        right=right,
        readable=is_readable(path),
    )


def read_final_cause(path: Path) -> tuple[str, str]:
    """Return cause and reason of a recording's last transition; empty texts if it has none."""
    last = transitions(path)
    return (last[-1]["cause"], last[-1]["reason"]) if last else ("", "")


def is_readable(path: Path) -> bool:
    """Return whether a recording can be read as far as it goes.

    A recording that ended before the test began contains only transitions.
    """
    try:
        recording = load(path)
    except RigtwinError as error:
        return "no ticks" in str(error) and bool(read_final_cause(path)[0])
    # Reading must also give usable times.
    return bool(np.all(np.isfinite(recording.time)))
