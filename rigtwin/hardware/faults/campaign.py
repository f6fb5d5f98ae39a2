"""Many sessions on the virtual card, each with one fault at a random time, and what became of each."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controllers import Commands
from controllers import update as healthy
from rigtwin.description.configuration import override
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.transport import InProcess
from rigtwin.hardware.daq.virtual import BAD_VALUE, DriverError, OnDemand, VirtualCard
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.kinds import KINDS, SIGNALS, Kind
from rigtwin.hardware.session.record import Test, record_at_leisure
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.supervised import ARMED, LOOKING, SETTLING
from rigtwin.recording import load
from rigtwin.recording.reader import transitions

EXPERIMENTS = ("drop", "road1.6", "semi-active", "imposed", "imposed-fast")
"""Model in the loop and imposed tests alike."""
DURATION = 3.0
"""s of each test; a fault comes at a random time of the ramp or the test."""
RAMP = 0.6
"""s."""
BEFORE = round(1000.0 * (LOOKING + ARMED + RAMP + SETTLING))
"""Ticks of the card before the test."""
SOON = 600
SLOW = 5
"""Ticks that pass during a slow one."""


@dataclass(frozen=True)
class Fault:
    """What is put into one session. at: tick of the card; place: input or output that has it."""

    kind: Kind
    experiment: str
    at: int
    place: int
    seed: int


@dataclass(frozen=True)
class Outcome:
    """What became of it. late: ticks from when the fault could be seen to safe outputs, None if it never could and the test was
    completed; from_start: ticks from the fault to safe outputs; exceeded: greatest true position, travel or force in its
    limit; cause, reason: as the recording says; right: whether they name the fault; readable: recording to its last tick."""

    fault: Fault
    late: int | None
    from_start: int
    exceeded: float
    cause: str
    reason: str
    right: bool
    readable: bool

    @property
    def passed(self) -> bool:
        """Whether the session was stopped as it must be."""
        return (self.late is None or self.late <= 5) and self.exceeded <= 1.1 and self.right and self.readable


def drawn(count: int, seed: int, kinds: Sequence[Kind] = KINDS) -> list[Fault]:
    """So many faults, the kinds in turn, everything else at random."""
    random = np.random.default_rng(seed)
    moving, ending = 1000.0 * (LOOKING + ARMED), BEFORE + 1000.0 * DURATION
    faults = []
    for number in range(count):
        kind = kinds[number % len(kinds)]
        place = int(random.integers(4)) if kind.place == "sensor" else int(random.integers(2))
        experiment = EXPERIMENTS[int(random.integers(len(EXPERIMENTS)))]
        first = BEFORE if kind.place in ("controller", "loop") or kind.name == "controller hangs" else moving
        # A process on a slowed card takes its time: its faults come in the ramp or soon after.
        last = min(ending, BEFORE + SOON) if kind.place == "process" else ending
        at = int(random.uniform(first + 20.0, last - 50.0))
        faults.append(Fault(kind, experiment, at, place, int(random.integers(2**31))))
    return faults


def test_of(fault: Fault, table: ChannelTable) -> Test:
    """The session that is to have a fault."""
    from experiments import find

    experiment = find(fault.experiment)
    changes = {"timing": {"duration": DURATION}, "safety": {"ramp": RAMP}}
    configuration = override(experiment.configuration, changes)
    return Test(fault.experiment, configuration, experiment.demands(configuration, fault.seed), fault.seed, table)


def whole(test: Test) -> int:
    """Ticks that a session may take, and some more."""
    return len(test.demands) + 4000


class _GlitchingCard(VirtualCard):
    """Refuses an output once, or is disconnected, when its time has come."""

    glitch: tuple[str, int] = ("", 0)

    def answer(self, call: str, request: Any, response: type) -> Any:
        kind, at = self.glitch
        if kind and self.tick >= at:
            if kind == "card disconnected":
                self.disconnect()
            elif call == "WriteAnalogF64":
                self.glitch = ("", 0)
                raise DriverError(BAD_VALUE, "the output was refused")
        return super().answer(call, request, response)


def tried(fault: Fault, table: ChannelTable, folder: Path) -> Outcome:
    """One fault in this process. Raises RigtwinError only if the session could not even begin."""
    test = test_of(fault, table)
    period, name = test.configuration.timing.period, fault.kind.name
    bench = FaultyBench(test.terminals(), table, name, fault.at, fault.place, fault.seed, whole(test))
    virtual = _GlitchingCard(bench, table, OnDemand())
    if fault.kind.place == "card":
        virtual.glitch = (name, fault.at)
    card = Card(table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    path, stop_file = folder / f"{fault.seed}.mcap", folder / f"{fault.seed}.stop"
    with _full_disk(path) as fill, stop_requests(stop_file) as asked:

        def stop() -> str | None:
            if virtual.tick >= fault.at:
                if name == "operator's signal" and virtual.tick == fault.at:
                    os.kill(os.getpid(), (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[fault.seed % 3])
                elif name == "operator's file":
                    stop_file.touch()
                elif name == "full disk":
                    fill()
            return asked()

        def flushed(_: int) -> None:
            if name == "full disk" and virtual.tick >= fault.at and bench.shown < 0:
                bench.shown = virtual.tick

        updating = _failing(fault, virtual) if fault.kind.place in ("controller", "loop") else healthy
        record_at_leisure(card, test, path, stop, flushed, updating)
    stop_file.unlink(missing_ok=True)
    return judged(fault, test, bench, path)


def _failing(fault: Fault, card: VirtualCard) -> Any:
    """A controller, or the loop around it, that fails in its time; before the test it is the first tick that fails."""

    def update(controlling: Any, state: Any, measured: Any, demand: Any) -> tuple[Any, Commands]:
        state, commands = healthy(controlling, state, measured, demand)
        if card.tick < fault.at:
            return state, commands
        if fault.kind.name == "controller exception":
            raise ZeroDivisionError("float division by zero")
        if fault.kind.name == "command not a number":
            return state, commands._replace(**{("structure", "voltage")[fault.place]: float("nan")})
        if fault.kind.name == "command jumps":
            step = {"structure": commands.structure + 0.05} if fault.place == 0 else {"voltage": commands.voltage - 11.0}
            return state, commands._replace(**step)
        card.run_until(card.tick + SLOW)
        return state, commands

    return update


@contextmanager
def _full_disk(path: Path) -> Iterator[Callable[[], None]]:
    """Gives a function after which the system lets no file grow any more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size, hard))

    try:
        yield fill
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def judged(fault: Fault, test: Test, bench: FaultyBench, path: Path) -> Outcome:
    """What the log of the terminals and the recording say."""
    ended = last_words(path)
    cause, reason = ended
    safe = bench.safe_from()
    harmless = cause == "completed"
    shown = fault.at if fault.kind.everywhere else bench.shown
    late = None if harmless and shown < 0 else safe - (shown if shown >= 0 else safe)
    named = fault.kind.place != "sensor" or cause not in ("jump", "stuck", "not_a_number") or SIGNALS[fault.place] in reason
    right = named and (cause in fault.kind.causes or (harmless and shown < 0))
    exceeded = bench.exceeded(test.limited.safety, fault.at)
    return Outcome(fault, late, safe - fault.at, exceeded, cause, reason, right, readable(path))


def last_words(path: Path) -> tuple[str, str]:
    """Cause and reason of a recording's last transition."""
    found = transitions(path)
    return (found[-1]["cause"], found[-1]["reason"]) if found else ("", "")


def readable(path: Path) -> bool:
    """Whether a recording can be read as far as it goes; one that ended before the test began has nothing but its states."""
    try:
        recording = load(path)
    except RigtwinError as error:
        return "no ticks" in str(error) and bool(last_words(path)[0])
    return bool(np.all(np.isfinite(recording.time)))
