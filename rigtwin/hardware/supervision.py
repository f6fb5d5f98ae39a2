"""A test on a rig that is ramped in and out under supervision.

The same for the real rig, its virtual card and the twin.

Between controller and rig stand the limits of `rigtwin.simulation.safety` and the states of
`rigtwin.hardware.supervisor`. Whatever goes wrong, the outputs go to the stop state at that tick:
motor to zero force, cylinders hold, and after a while their pressure is taken off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from controllers import (
    Commands,
    Controller,
    Demand,
    Measurements,
    Mode,
    State,
    controller,
    initial_state,
    update,
)
from controllers.force import MOTOR_CONSTANT
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.hardware.realtime import Lateness, monotonic
from rigtwin.hardware.supervisor import COMPLETED, Cause, Phase, Supervisor, Transition
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.loop import BLOCK
from rigtwin.simulation.rig import DrivenRig
from rigtwin.simulation.safety import (
    Trip,
    empty_memory,
    explain_trip,
    find_arming_obstacle,
    is_beyond,
    judge_commands,
    judge_measurements,
    stop_state,
)

LOOKING = 0.3
"""s for which the sensors are looked at before the rig is armed; it also warms up everything that
a tick needs."""
ARMED = 0.1
"""s of pressure before anything is moved."""
SETTLING = 0.3
"""s at the start position between the ramp and the test."""

OFTEN, MOST_MISSED = 0.005, 0.2
"""Share by which a tick enters the average of ticks missed, and what that may be: one in five,
over some 200."""
NOT_HELD = ("following", "structure", "ground", "travel", "velocity", "wheel")
"""Causes after which cylinders are not held under pressure: one of them may be what is wrong."""
UNREAD = Measurements(math.nan, math.nan, math.nan, math.nan)

Update = Callable[[Controller, State, Measurements, Demand], tuple[State, Commands]]


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

    def beat(self, ground: float, structure: float) -> None:
        """Called once a tick: the loop is alive, and holds the cylinders there, m."""
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
        Greatest magnitude of each measurement, and of the commands' voltage.
    """

    cause: Cause
    ticks: int
    transitions: tuple[Transition, ...]
    peaks: dict[str, float]


def supervise(
    rig: DrivenRig,
    configuration: Configuration,
    demands: Array,
    recorder: Recorder,
    stop: Callable[[], str | None] = lambda: None,
    lateness: Lateness | None = None,
    updating: Update = update,
    progress: Callable[[int], object] = lambda _: None,
) -> SessionEnd:
    """Runs a test, ramped in and out.

    Parameters
    ----------
    rig : DrivenRig
        What is moved.
    configuration : Configuration
        With the limits that the card adds.
    demands : Array
        Columns of controllers.Demand, shape (ticks, 3).
    recorder : Recorder
        Keeps what happens.
    stop : callable
        Looked at in every tick; a text stops the session and is its reason.
    lateness : Lateness, optional
        Is filled, if the rig runs in real time.
    updating : Update
        The controller. It is asked once before anything moves, and that answer is thrown away.
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
    return _Session(
        rig,
        configuration,
        demands,
        recorder,
        stop=stop,
        lateness=lateness,
        updating=updating,
        progress=progress,
    ).run()


class _Session:
    def __init__(
        self,
        rig: DrivenRig,
        configuration: Configuration,
        demands: Array,
        recorder: Recorder,
        stop: Callable[[], str | None],
        lateness: Lateness | None,
        updating: Update,
        progress: Callable[[int], object],
    ) -> None:
        self._rig, self._limits, self._demands = rig, configuration.safety, demands
        self._period = configuration.timing.period
        self._recorder, self._stop, self._lateness = recorder, stop, lateness
        self._updating, self._progress = updating, progress
        self._controller = controller(configuration.controller, self._period)
        self._state = initial_state(self._controller)
        self._memory = empty_memory()
        self._supervisor = Supervisor(recorder.transition)
        self._target = self._start_of(configuration, demands)
        self._before = (LOOKING, ARMED, self._limits.ramp, SETTLING)
        self._clock = -round(sum(self._before) / self._period)
        self._held, self._pressure = Commands(0.0, 0.0, 0.0, 0.0), False
        self._told = self._done_before = 0
        self._behind = 0.0
        self._done, self._peaks = 0, [0.0] * 5

    @staticmethod
    def _start_of(configuration: Configuration, demands: Array) -> Commands:
        settings = configuration.controller
        ground, structure, force = demands[0].tolist()
        if settings.mode != Mode.IMPOSED:
            structure, force = settings.start, settings.preload
        return Commands(ground, structure, force, force / MOTOR_CONSTANT)

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
        names = (*Measurements._fields, "voltage")
        transitions = tuple(self._supervisor.transitions)
        return SessionEnd(
            transitions[-1].cause,
            self._done,
            transitions,
            dict(zip(names, self._peaks, strict=True)),
        )

    def _look(self) -> Commands:
        """Idle: whether every sensor lives and lies within its limit.

        Returns the commands at which nothing moves. Raises RigtwinError if the rig must not be
        armed.
        """
        measured = self._rig.read()
        refused = find_arming_obstacle(self._limits, measured)
        if refused is not None:
            raise RigtwinError(f"not armed: {refused}")
        rest = self._held = Commands(measured.ground_lvdt, measured.structure_lvdt, 0.0, 0.0)
        self._updating(self._controller, self._state, measured, Demand(*self._demands[0].tolist()))
        for _ in range(max(round(LOOKING / self._period), 1)):
            self._rig.write(rest)
            cause = self._find_fault(measured)
            number, column = judge_commands(
                self._limits, self._interval, self._memory, measured, rest
            )
            if number != Trip.NONE:
                cause = Cause(
                    Trip(number).name.lower(), explain_trip(Trip(number), self._limits, column)
                )
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
        self._pressure = True
        self._rig.pressure(True)
        for _ in range(round(ARMED / self._period)):
            cause = self._tick(lambda _: rest)
            if cause is not None:
                return cause
        self._supervisor.go(
            Phase.RAMPING, Cause("ramp", "ramping to the start", fault=False), self._time
        )
        for share in _cosine_shares(self._limits.ramp, self._period):
            between = Commands(
                *(a + share * (b - a) for a, b in zip(rest, self._target, strict=True))
            )
            cause = self._tick(lambda _, between=between: between)
            if cause is not None:
                return cause
        while self._clock < 0:
            cause = self._tick(lambda _: self._target)
            if cause is not None:
                return cause
        self._clock = 0
        self._supervisor.go(
            Phase.RUNNING, Cause("test", "at the start; the test begins", fault=False), self._time
        )
        while self._clock < len(self._demands):
            cause = self._tick(self._control)
            if cause is not None:
                return cause
        return COMPLETED

    def _control(self, measured: Measurements) -> Commands:
        demand = Demand(*self._demands[self._clock].tolist())
        self._state, commands = self._updating(self._controller, self._state, measured, demand)
        return commands

    def _tick(self, command: Callable[[Measurements], Commands]) -> Cause | None:
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
        if cause is None and running and self._clock >= len(self._demands):
            return COMPLETED
        commands = self._held
        if cause is None:
            try:
                commands = command(measured)
                number, column = judge_commands(
                    self._limits, self._interval, self._memory, measured, commands
                )
                if number != Trip.NONE:
                    cause = Cause(
                        Trip(number).name.lower(), explain_trip(Trip(number), self._limits, column)
                    )
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

    def _find_fault(self, measured: Measurements) -> Cause | None:
        """What is wrong besides the commands."""
        self._recorder.beat(self._held.ground, self._held.structure)
        number, column = judge_measurements(self._limits, self._interval, self._memory, measured)
        missed = self._rig.missed
        if missed > self._limits.missed:
            return Cause(
                "late", f"{missed} ticks missed in a row; at most {self._limits.missed:g} may be"
            )
        self._behind += OFTEN * (missed / (1.0 + missed) - self._behind)
        if self._behind > MOST_MISSED:
            return Cause(
                "late",
                f"of the last ticks {100 * self._behind:.0f} % were missed; "
                "the loop cannot keep the pace",
            )
        if number != Trip.NONE:
            return Cause(
                Trip(number).name.lower(), explain_trip(Trip(number), self._limits, column)
            )
        fault = self._recorder.fault
        if fault is not None:
            return Cause("recording", fault)
        asked = self._stop()
        return Cause("operator", asked, fault=False) if asked is not None else None

    def _halt(
        self,
        cause: Cause,
        measured: Measurements = UNREAD,
        commands: Commands | None = None,
        tick: float = math.nan,
    ) -> Cause:
        """Outputs to the stop state, now: no force, cylinders where they were last told to be.

        Then it is noted.
        """
        self._held = stop_state(self._limits, self._held)
        try:
            self._rig.write(self._held)
        except Exception:
            self._pressure = False
            self._rig.stop()
        self._row(measured, commands or self._held, tick)
        return cause

    def _come_to_rest(self, cause: Cause, rest: Commands) -> None:
        """Back to where it stood, if all is well; else hold. Then take the pressure off."""
        self._supervisor.go(Phase.STOPPING, cause, self._time)
        if cause == COMPLETED:
            later = self._ramp_out(rest)
            cause = later or cause
        for _ in range(0 if cause.name in NOT_HELD else round(self._limits.hold / self._period)):
            if not self._pressure or not self._hold():
                break
        try:
            self._rig.pressure(False)
        except Exception:
            self._rig.stop()
        self._pressure = False
        # Nothing is left that could move: giving the card back may take its time.
        self._supervisor.go(Phase.FAULTED if cause.fault else Phase.STOPPED, cause, self._time)

    def _ramp_out(self, rest: Commands) -> Cause | None:
        begin = self._held
        for share in _cosine_shares(self._limits.ramp, self._period):
            between = Commands(*(a + share * (b - a) for a, b in zip(begin, rest, strict=True)))
            cause = self._tick(lambda _, between=between: between)
            if cause is not None:
                return cause
        self._held = stop_state(self._limits, self._held)
        return None

    def _hold(self) -> bool:
        """A tick of holding.

        False if there is no use in it: the card is gone, or a cylinder is beyond its limit.
        """
        try:
            measured = self._rig.read()
            self._rig.write(self._held)
        except Exception:
            return False
        self._recorder.beat(self._held.ground, self._held.structure)
        self._clock += self._rig.missed
        self._row(measured, self._held)
        return not is_beyond(self._limits, measured)

    def _row(self, measured: Measurements, commands: Commands, tick: float = math.nan) -> None:
        """Notes a tick, which is over with that.

        tick: its number in the test, if it is of the test.
        """
        held, rig = self._held, self._rig
        written = (held.ground, held.structure, held.voltage, float(self._pressure))
        late, phase = getattr(rig, "late", 0.0), float(self._supervisor.phase)
        self._recorder.tick(
            (self._time, phase, *written, *measured, late, float(rig.missed), *commands, tick)
        )
        for place, value in enumerate((*measured, commands.voltage)):
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
