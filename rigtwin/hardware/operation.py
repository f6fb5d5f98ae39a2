"""What a session has to know of a machine that it leads into a test and out of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from rigtwin.hardware.daq.signals import Signals
from rigtwin.hardware.supervisor import Cause

Sample = Any
"""What was read: of the rig `controllers.Measurements`, of another machine its inputs' values."""
Commands = Any
"""What is commanded: of the rig `controllers.Commands`, of another machine its outputs' values and
what else is demanded."""


@dataclass(frozen=True)
class Course:
    """Times of a session, s. looking: at the sensors, before power; armed: under power before
    anything is moved; ramp: to the start of the test, and back; settling: there; hold: after a
    stop, before power is taken off."""

    looking: float
    armed: float
    ramp: float
    settling: float
    hold: float


class Operation(Protocol):
    """A test of one machine, and how that machine is kept safe.

    signals: what it has; period: s; ticks: of the test; course: of its session; missed: ticks that
    may be missed in a row; rest: commands at which nothing moves, once `look` was called; target:
    commands at the start of the test; watched: names of what `watch` gives.
    """

    signals: Signals
    period: float
    ticks: int
    course: Course
    missed: float
    rest: Commands
    target: Commands
    watched: tuple[str, ...]

    def look(self, measured: Sample) -> str | None:
        """Why it may not be armed as it stands, or None. Sets `rest`; what a tick needs is warmed
        up."""
        ...

    def control(self, tick: int, measured: Sample) -> Commands:
        """The controller's commands at a tick of the test."""
        ...

    def judge_measured(self, measured: Sample, interval: float) -> Cause | None:
        """What is wrong with what was read, s after the tick before."""
        ...

    def judge_commands(self, measured: Sample, commands: Commands, interval: float) -> Cause | None:
        """What is wrong with commands that are to be written."""
        ...

    def stop_state(self, held: Commands) -> Commands:
        """Commands that are safe after those that were held."""
        ...

    def holds_after(self, cause: Cause) -> bool:
        """Whether it may be kept under power for a while after a stop for that cause."""
        ...

    def may_be_held(self, measured: Sample) -> bool:
        """Whether it still may, as it stands."""
        ...

    def watch(self, measured: Sample, commands: Commands) -> tuple[float, ...]:
        """Whose greatest magnitudes are told of a session."""
        ...
