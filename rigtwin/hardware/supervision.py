"""Supervised test: ramped in and out, on the real rig, its virtual card or the twin.

The limits of the `Operation` and the states of `rigtwin.hardware.supervisor` stand between
controller and rig. At any fault the outputs go to the stop state in the same tick: zero force,
positions held. The power is switched off after a while.
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
"""Weight of a tick in the moving average of missed ticks, about 200 ticks long, and the average's
upper limit, one in five."""


class Recorder(Protocol):
    """Interface of a recorder of a session.

    `fault` is why it cannot record any more, or None; it is checked in every tick.
    """

    @property
    def fault(self) -> str | None: ...

    def tick(self, row: tuple[float, ...]) -> None:
        """Record one tick.

        A row has the fields of /session, those of /command, and the tick's number in the test,
        which is NaN outside the test.
        """
        ...

    def transition(self, transition: Transition) -> None: ...

    def ready(self) -> None:
        """Prepare for motion: the rig's lines are open, and nothing moves yet.

        Raises RigtwinError if the session must not begin.
        """
        ...

    def beat(self, outputs: Sequence[float]) -> None:
        """Note once a tick that the loop is alive, and which outputs would be safe."""
        ...

    def flush(self) -> None:
        """Write what is not written yet, once nothing moves any more."""
        ...


@dataclass(frozen=True)
class SessionEnd:
    """End of a session.

    Parameters
    ----------
    cause : Cause
        Cause of the end.
    ticks : int
        Number of recorded ticks of the test.
    transitions : tuple of Transition
        All transitions in order.
    peaks : dict
        Largest magnitude of each signal that the operation watches.
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
    """Run a test, ramped in and out.

    Parameters
    ----------
    rig : DrivenRig
        Rig that is moved.
    operation : Operation
        Test, and the rules that keep the machine safe.
    recorder : Recorder
        Recorder of the session.
    stop : callable
        Function called in every tick; a text it returns stops the session and is the reason.
    lateness : Lateness, optional
        Statistics to be filled, if the rig runs in real time.
    progress : callable
        Function called with the number of ticks since its last call.

    Returns
    -------
    SessionEnd
        End of the session.

    Raises
    ------
    RigtwinError
        If the session cannot begin; nothing has moved then.
    """
    return _Session(rig, operation, recorder, stop, lateness, progress).run()


class _Session:
    """State of a supervised test. See `supervise` for the arguments."""

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
        # Time zero is the start of the test, so that ticks before it have negative times.
        self._clock = -round(sum(before) / self._period)
        # The last commands, which the stop state holds, and whether there is power.
        self._held, self._power = operation.rest, False
        self._unread = self._signals.sample(*[math.nan] * len(self._signals.inputs))
        self._ticks_noted = self._done_before = 0
        self._behind = 0.0
        self._done, self._peaks = 0, [0.0] * len(operation.watched)

    @property
    def _interval(self) -> float:
        """Time since the last tick, in s, including missed ticks."""
        return (1 + self._rig.missed) * self._period

    @property
    def _time(self) -> float:
        return self._clock * self._period

    def run(self) -> SessionEnd:
        """Go through all states. Every path after arming ends in `_come_to_rest`."""
        rig, recorder = self._rig, self._recorder
        try:
            try:
                rig.start()
                recorder.ready()
                rest = self._look()
            # BaseException, here and below: Ctrl-C and SystemExit must not leave the rig moving.
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
            # Also reached if coming to rest itself failed: the card's own stop is the last means.
            rig.stop()
            # A recording must end in a final state, even if the way there raised an error.
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
        """Check in the idle state that every sensor works and is within its limit.

        Returns
        -------
        Commands
            Commands at which nothing moves.

        Raises
        ------
        RigtwinError
            If the rig must not be armed.
        """
        measured = self._rig.read()
        refused = self._operation.look(measured)
        if refused is not None:
            raise RigtwinError(f"not armed: {refused}")
        # Commands equal to the present position: arming must not move anything.
        rest = self._held = self._operation.rest
        for _ in range(max(round(self._course.looking / self._period), 1)):
            self._rig.write(rest)
            # Writing without power moves nothing, and shows that the card accepts outputs.
            cause = self._find_fault(measured)
            cause = self._operation.judge_commands(measured, rest, self._interval) or cause
            # Late ticks are expected here: everything runs for the first time.
            if cause is not None and cause.name != "late":
                raise RigtwinError(f"not armed: {cause.reason}")
            self._row(measured, rest)
            measured = self._rig.read()
        return rest

    def _move(self, rest: Commands) -> Cause:
        """Go through armed, ramping and running. Return the cause of the end."""
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
        # Settling ends when the clock reaches the start, whatever ticks were missed in the ramp.
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
        """Yield commands from one point to another without a jump in velocity.

        Nothing is yielded if the course has no ramp.
        """
        if self._course.ramp == 0.0:
            return
        for share in _cosine_shares(self._course.ramp, self._period):
            yield self._signals.commands(
                *(a + share * (b - a) for a, b in zip(begin, end, strict=True))
            )

    def _tick(self, command: Callable[[Sample], Commands]) -> Cause | None:
        """Do one tick: read, judge the sample, command, judge the commands, write.

        Returns
        -------
        Cause or None
            Cause to stop, after the outputs are at the stop state; None to continue.
        """
        running = self._supervisor.phase == Phase.RUNNING
        try:
            measured = self._rig.read()
        except Exception as error:
            return self._halt(_cause_of(error))
        # The work is timed from the sample on; waiting for it is no work.
        begun = monotonic()
        # A missed tick counts as passed: the demands belong to times, not to readings.
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
            # A controller is a user's code: whatever it raises must stop the rig, not the program.
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
        """Return what is wrong besides the commands, or None."""
        self._beat()
        judgement = self._operation.judge_measured(measured, self._interval)
        missed, most = self._rig.missed, self._operation.missed
        # Lateness is reported first: after missed ticks a sensor's jump is only a consequence.
        if missed > most:
            return Cause("late", f"{missed} ticks missed in a row; at most {most:g} may be")
        # Moving average of the share of missed ticks among those that were due.
        self._behind += OFTEN * (missed / (1.0 + missed) - self._behind)
        if self._behind > MOST_MISSED:
            return Cause(
                "late",
                f"of the last ticks {100 * self._behind:.0f} % were missed; "
                "the loop cannot keep the pace",
            )
        if judgement is not None:
            return judgement
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
        """Set the outputs to the stop state at once, then record the tick.

        The stop state has zero force, and positions as last commanded.
        """
        self._held = self._operation.stop_state(self._held)
        try:
            self._rig.write(self._held)
        # A card that accepts no output is stopped by its own means, which remove the power.
        except Exception:
            self._power = False
            self._rig.stop()
        self._row(self._unread if measured is None else measured, commands or self._held, tick)
        return cause

    def _come_to_rest(self, cause: Cause, rest: Commands) -> None:
        """Return to the initial position after a completed test, else hold; then remove power."""
        self._supervisor.go(Phase.STOPPING, cause, self._time)
        if cause == COMPLETED:
            later = self._ramp_out(rest)
            cause = later or cause
        # Positions are held under power for a while, unless a cylinder may be at fault.
        holds = self._operation.holds_after(cause)
        for _ in range(round(self._course.hold / self._period) if holds else 0):
            if not self._power or not self._hold():
                break
        try:
            self._rig.power(False)
        except Exception:
            self._rig.stop()
        self._power = False
        # Nothing can move any more, so releasing the card may take its time.
        self._supervisor.go(Phase.FAULTED if cause.fault else Phase.STOPPED, cause, self._time)

    def _ramp_out(self, rest: Commands) -> Cause | None:
        """Ramp back to the initial position. Return the cause if the ramp had to be stopped."""
        begin = self._held
        for between in self._ramp(begin, rest):
            cause = self._tick(lambda _, between=between: between)
            if cause is not None:
                return cause
        self._held = self._operation.stop_state(self._held)
        return None

    def _hold(self) -> bool:
        """Hold for one tick. Return False if the card is gone or the rig must not be held."""
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
        """Tell the recorder that the loop is alive, and which outputs are safe now."""
        # The guardian would write these values if the loop died in this tick.
        safe = self._operation.stop_state(self._held)
        self._recorder.beat(self._signals.to_write(safe))

    def _row(self, measured: Sample, commands: Commands, tick: float = math.nan) -> None:
        """Record a tick, which ends with that. `tick` is its number in the test, or NaN."""
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
        self._ticks_noted += 1
        # Progress is reported once a block, because a call per tick would cost time.
        if self._ticks_noted % BLOCK == 0:
            self._progress(self._done - self._done_before)
            self._done_before = self._done


def _cosine_shares(duration: float, period: float) -> Iterator[float]:
    """Yield shares from 0 to 1, by a cosine without a jump in velocity."""
    # A raised cosine starts and ends at rest.
    ticks = max(1, round(duration / period))
    for tick in range(1, ticks + 1):
        yield 0.5 - 0.5 * math.cos(math.pi * tick / ticks)


def _line(error: BaseException) -> str:
    """Return the text of an error in one line."""
    return " ".join(str(error).split()) or "no message"


def _cause_of(error: BaseException) -> Cause:
    """Return the cause that an error stands for."""

    if isinstance(error, KeyboardInterrupt):
        return Cause("operator", "stopped by the operator: interrupted", fault=False)
    if isinstance(error, RigtwinError):
        return Cause("card", _line(error))
    return Cause("rig", f"{type(error).__name__}: {_line(error)}")
