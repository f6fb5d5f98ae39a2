"""Interface between a session and the machine that it ramps into a test and out of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from rigtwin.hardware.daq.signals import Signals
from rigtwin.hardware.supervisor import Cause

# A session is independent of the machine, so these types are opaque to it.
Sample = Any
"""Sample: `controllers.Measurements` of the rig, or a tuple of another machine's inputs."""
Commands = Any
"""Commands: `controllers.Commands` of the rig, or a tuple of another machine's outputs and further
demands."""


@dataclass(frozen=True)
class Course:
    """Times of a session's phases, in s.

    Attributes
    ----------
    looking
        Check of the sensors before power.
    armed
        Power before anything moves.
    ramp
        Motion to the start of the test, and back.
    settling
        Rest at the start.
    hold
        Power after a stop.
    """

    looking: float
    armed: float
    ramp: float
    settling: float
    hold: float


class Operation(Protocol):
    """Test of one machine, with the rules that keep the machine safe.

    Attributes
    ----------
    signals
        Signals of the machine.
    period
        Period of a tick, in s.
    ticks
        Number of ticks of the test.
    course
        Times of the session's phases.
    missed
        Maximum number of ticks missed in a row.
    rest
        Commands at which nothing moves; valid once `look` was called.
    target
        Commands at the start of the test.
    watched
        Names of the values that `watch` returns.
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
        """Return why the machine must not be armed as it stands, or None.

        The call sets `rest`, and warms up everything that a tick needs.
        """
        ...

    def control(self, tick: int, measured: Sample) -> Commands:
        """Return the controller's commands at a tick of the test."""
        ...

    def judge_measured(self, measured: Sample, interval: float) -> Cause | None:
        """Return what is wrong with a sample, or None; `interval` since the last one is in s."""
        ...

    def judge_commands(self, measured: Sample, commands: Commands, interval: float) -> Cause | None:
        """Return what is wrong with commands before they are written, or None."""
        ...

    def stop_state(self, held: Commands) -> Commands:
        """Return the safe commands that follow held ones."""
        ...

    def holds_after(self, cause: Cause) -> bool:
        """Return whether the machine may stay under power for a while after a stop for a cause."""
        ...

    def may_be_held(self, measured: Sample) -> bool:
        """Return whether the machine may still stay under power, given a sample."""
        ...

    def watch(self, measured: Sample, commands: Commands) -> tuple[float, ...]:
        """Return the signals whose largest magnitudes a session reports."""
        ...
