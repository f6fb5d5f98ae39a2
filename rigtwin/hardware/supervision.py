"""A test on a rig that is ramped in and out under supervision.

The same for the real rig, its virtual card and the twin.

Between controller and rig stand its limits, which are part of its `Operation`, and the states of
`rigtwin.hardware.supervisor`. Whatever goes wrong, the outputs go to the stop state at that tick:
no force, positions held, and after a while power is taken off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from rigtwin.errors import RigtwinError
from rigtwin.hardware.operation import Commands, Operation, Sample
from rigtwin.hardware.realtime import Lateness
from rigtwin.hardware.supervisor import COMPLETED, Cause, Phase, Supervisor, Transition
from rigtwin.simulation.loop import BLOCK
from rigtwin.simulation.rig import DrivenRig
from rigtwin.system import monotonic

OFTEN, MOST_MISSED = 0.005, 0.2
"""Share by which a tick enters the average of ticks missed, and what that may be: one in five,
over some 200."""


class Recorder(Protocol):
    """Keeps what a session does.

    `fault`: why it cannot any more, or None; looked at in every tick.
    """

    @property
    def fault(self) -> str | None: ...

    def tick(self, row: tuple[float, ...]) -> None:
        """One tick of the session.

        The fields of /session, those of /command, then the tick's number in the test, not a number
        outside it.
        """
        ...

    def transition(self, transition: Transition) -> None: ...

    def ready(self) -> None:
        """Called when the rig's lines are there and nothing moves yet.

        Raises RigtwinError if the session must not begin.
        """
        ...

    def beat(self, outputs: Sequence[float]) -> None:
        """Called once a tick: the loop is alive, and these outputs would be safe."""
        ...

    def flush(self) -> None:
        """Called when nothing moves any more: what is not written yet is to be."""
        ...


@dataclass(frozen=True)
class SessionEnd:
    """How a session ended.

    Parameters
    ----------
    cause : Cause
        Why.
    ticks : int
        Of the test that were recorded.
    transitions : tuple of Transition
        All of them, in order.
    peaks : dict
        Greatest magnitude of each signal that the operation watches.
    """

    cause: Cause
    ticks: int
    transitions: tuple[Transition, ...]
    peaks: dict[str, float]


def supervise(
    rig: DrivenRig,
    operation: Operation,
    recorder: Recorder,
    stop: Callable[[], str | None] = lambda: None,
    lateness: Lateness | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> SessionEnd:
    """Runs a test, ramped in and out.

    Parameters
    ----------
    rig : DrivenRig
        What is moved.
    operation : Operation
        The test, and how the machine is kept safe.
    recorder : Recorder
        Keeps what happens.
    stop : callable
        Looked at in every tick; a text stops the session and is its reason.
    lateness : Lateness, optional
        Is filled, if the rig runs in real time.
    progress : callable
        Called with the ticks done since its last call.

    Returns
    -------
    SessionEnd
        How it ended.

    Raises
    ------
    RigtwinError
        Only before anything has moved.
    """
    return _Session(rig, operation, recorder, stop, lateness, progress).run()


class _Session:
    def __init__(
        self,
        rig: DrivenRig,
        operation: Operation,
        recorder: Recorder,
        stop: Callable[[], str | None],
        lateness: Lateness | None,
        progress: Callable[[int], object],
    ) -> None:
        self._rig, self._operation, self._course = rig, operation, operation.course
        self._period, self._signals = operation.period, operation.signals
        self._recorder, self._stop, self._lateness = recorder, stop, lateness
        self._progress = progress
        self._supervisor = Supervisor(recorder.transition)
        course = self._course
        before = (course.looking, course.armed, course.ramp, course.settling)
        self._clock = -round(sum(before) / self._period)
        self._held, self._power = operation.rest, False
        self._unread = self._signals.sample(*[math.nan] * len(self._signals.inputs))
        self._told = self._done_before = 0
        self._behind = 0.0
        self._done, self._peaks = 0, [0.0] * len(operation.watched)

    @property
    def _interval(self) -> float:
        """s since the tick before, of which some may have been missed."""
        return (1 + self._rig.missed) * self._period

    @property
    def _time(self) -> float:
        return self._clock * self._period

    def run(self) -> SessionEnd:
        """The way through all states; every step of it ends in `_come_to_rest`."""
        rig, recorder = self._rig, self._recorder
        try:
            try:
                rig.start()
                recorder.ready()
                rest = self._look()
            except BaseException as error:
                rig.stop()
                self._supervisor.go(Phase.FAULTED, _cause_of(error), self._time)
                raise
            try:
                cause = self._move(rest)
            except BaseException as error:
                cause = self._halt(_cause_of(error))
            self._come_to_rest(cause, rest)
        finally:
            rig.stop()
            if self._supervisor.phase == Phase.STOPPING:
                self._supervisor.go(
                    Phase.FAULTED, Cause("rig", "cut short while it was coming to rest"), self._time
                )
            recorder.flush()
            self._progress(self._done - self._done_before)
        transitions = tuple(self._supervisor.transitions)
        return SessionEnd(
            transitions[-1].cause,
            self._done,
            transitions,
            dict(zip(self._operation.watched, self._peaks, strict=True)),
        )

    def _look(self) -> Commands:
        """Idle: whether every sensor lives and lies within its limit.

        Returns the commands at which nothing moves. Raises RigtwinError if the rig must not be
        armed.
        """
        measured = self._rig.read()
        refused = self._operation.look(measured)
        if refused is not None:
            raise RigtwinError(f"not armed: {refused}")
        rest = self._held = self._operation.rest
        for _ in range(max(round(self._course.looking / self._period), 1)):
            self._rig.write(rest)
            cause = self._find_fault(measured)
            cause = self._operation.judge_commands(measured, rest, self._interval) or cause
            if cause is not None and cause.name != "late":
                raise RigtwinError(f"not armed: {cause.reason}")
            self._row(measured, rest)
            measured = self._rig.read()
        return rest

    def _move(self, rest: Commands) -> Cause:
        """Armed, ramping, running. Returns why it ended."""
        self._supervisor.go(
            Phase.ARMED,
            Cause("operator", "every sensor lives and is within its limit", fault=False),
            self._time,
        )
        self._power = True
        self._rig.power(True)
        for _ in range(round(self._course.armed / self._period)):
            cause = self._tick(lambda _: rest)
            if cause is not None:
                return cause
        self._supervisor.go(
            Phase.RAMPING, Cause("ramp", "ramping to the start", fault=False), self._time
        )
        for between in self._ramp(rest, self._operation.target):
            cause = self._tick(lambda _, between=between: between)
            if cause is not None:
                return cause
        while self._clock < 0:
            cause = self._tick(lambda _: self._operation.target)
            if cause is not None:
                return cause
        self._clock = 0
        self._supervisor.go(
            Phase.RUNNING, Cause("test", "at the start; the test begins", fault=False), self._time
        )
        while self._clock < self._operation.ticks:
            cause = self._tick(self._control)
            if cause is not None:
                return cause
        return COMPLETED

    def _control(self, measured: Sample) -> Commands:
        return self._operation.control(self._clock, measured)

    def _ramp(self, begin: Commands, end: Commands) -> Iterator[Commands]:
        """From one to the other, without a jump in velocity; nothing where no time is for it."""
        if self._course.ramp == 0.0:
            return
        for share in _cosine_shares(self._course.ramp, self._period):
            yield self._signals.commands(
                *(a + share * (b - a) for a, b in zip(begin, end, strict=True))
            )

    def _tick(self, command: Callable[[Sample], Commands]) -> Cause | None:
        """One tick: read, look, command, look, write.

        Returns why the session must stop, after the outputs are at the stop state, or None.
        """
        running = self._supervisor.phase == Phase.RUNNING
        try:
            measured = self._rig.read()
        except Exception as error:
            return self._halt(_cause_of(error))
        begun = monotonic()
        self._clock += self._rig.missed
        if self._lateness is not None:
            self._lateness.missed += self._rig.missed
        cause = self._find_fault(measured)
        if cause is None and running and self._clock >= self._operation.ticks:
            return COMPLETED
        commands = self._held
        if cause is None:
            try:
                commands = command(measured)
                cause = self._operation.judge_commands(measured, commands, self._interval)
            except Exception as error:
                commands = self._held
                cause = Cause(
                    "controller", f"the controller failed: {type(error).__name__}: {_line(error)}"
                )
        tick = float(self._clock) if running else math.nan
        if cause is not None:
            return self._halt(cause, measured, commands, tick)
        try:
            self._rig.write(commands)
        except Exception as error:
            return self._halt(_cause_of(error), measured, commands, tick)
        self._held = commands
        self._row(measured, commands, tick)
        if self._lateness is not None:
            self._lateness.add(getattr(self._rig, "late", 0.0), monotonic() - begun)
        return None

    def _find_fault(self, measured: Sample) -> Cause | None:
        """What is wrong besides the commands."""
        self._beat()
        found = self._operation.judge_measured(measured, self._interval)
        missed, most = self._rig.missed, self._operation.missed
        if missed > most:
            return Cause("late", f"{missed} ticks missed in a row; at most {most:g} may be")
        self._behind += OFTEN * (missed / (1.0 + missed) - self._behind)
        if self._behind > MOST_MISSED:
            return Cause(
                "late",
                f"of the last ticks {100 * self._behind:.0f} % were missed; "
                "the loop cannot keep the pace",
            )
        if found is not None:
            return found
        fault = self._recorder.fault
        if fault is not None:
            return Cause("recording", fault)
        asked = self._stop()
        return Cause("operator", asked, fault=False) if asked is not None else None

    def _halt(
        self,
        cause: Cause,
        measured: Sample = None,
        commands: Commands | None = None,
        tick: float = math.nan,
    ) -> Cause:
        """Outputs to the stop state, now: no force, positions where they were last told to be.

        Then it is noted.
        """
        self._held = self._operation.stop_state(self._held)
        try:
            self._rig.write(self._held)
        except Exception:
            self._power = False
            self._rig.stop()
        self._row(self._unread if measured is None else measured, commands or self._held, tick)
        return cause

    def _come_to_rest(self, cause: Cause, rest: Commands) -> None:
        """Back to where it stood, if all is well; else hold. Then take the power off."""
        self._supervisor.go(Phase.STOPPING, cause, self._time)
        if cause == COMPLETED:
            later = self._ramp_out(rest)
            cause = later or cause
        holds = self._operation.holds_after(cause)
        for _ in range(round(self._course.hold / self._period) if holds else 0):
            if not self._power or not self._hold():
                break
        try:
            self._rig.power(False)
        except Exception:
            self._rig.stop()
        self._power = False
        # Nothing is left that could move: giving the card back may take its time.
        self._supervisor.go(Phase.FAULTED if cause.fault else Phase.STOPPED, cause, self._time)

    def _ramp_out(self, rest: Commands) -> Cause | None:
        begin = self._held
        for between in self._ramp(begin, rest):
            cause = self._tick(lambda _, between=between: between)
            if cause is not None:
                return cause
        self._held = self._operation.stop_state(self._held)
        return None

    def _hold(self) -> bool:
        """A tick of holding.

        False if there is no use in it: the card is gone, or it must not be held.
        """
        try:
            measured = self._rig.read()
            self._rig.write(self._held)
        except Exception:
            return False
        self._beat()
        self._clock += self._rig.missed
        self._row(measured, self._held)
        return self._operation.may_be_held(measured)

    def _beat(self) -> None:
        safe = self._operation.stop_state(self._held)
        self._recorder.beat(self._signals.to_write(safe))

    def _row(self, measured: Sample, commands: Commands, tick: float = math.nan) -> None:
        """Notes a tick, which is over with that.

        tick: its number in the test, if it is of the test.
        """
        held, rig = self._held, self._rig
        written = (*self._signals.to_write(held), float(self._power))
        late, phase = getattr(rig, "late", 0.0), float(self._supervisor.phase)
        self._recorder.tick(
            (self._time, phase, *written, *measured, late, float(rig.missed), *commands, tick)
        )
        for place, value in enumerate(self._operation.watch(measured, commands)):
            if abs(value) > self._peaks[place]:
                self._peaks[place] = abs(value)
        self._done += not math.isnan(tick)
        self._clock += 1
        self._told += 1
        if self._told % BLOCK == 0:
            self._progress(self._done - self._done_before)
            self._done_before = self._done


def _cosine_shares(duration: float, period: float) -> Iterator[float]:
    """From 0 to 1 without a jump in velocity."""
    ticks = max(1, round(duration / period))
    for tick in range(1, ticks + 1):
        yield 0.5 - 0.5 * math.cos(math.pi * tick / ticks)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or "no message"


def _cause_of(error: BaseException) -> Cause:
    if isinstance(error, KeyboardInterrupt):
        return Cause("operator", "stopped by the operator: interrupted", fault=False)
    if isinstance(error, RigtwinError):
        return Cause("card", _line(error))
    return Cause("rig", f"{type(error).__name__}: {_line(error)}")
