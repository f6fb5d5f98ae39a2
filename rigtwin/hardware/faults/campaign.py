"""Many sessions on the virtual card, each with one fault at a random time, and their results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from google.protobuf.message import Message

from controllers import Commands, Controller, Demand, Measurements, State
from rigtwin.description.changes import override
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.transport import InProcess
from rigtwin.hardware.daq.virtual import BAD_VALUE, DriverError, OnDemand, Response, VirtualCard
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.kinds import KINDS, SIGNALS, FaultKind
from rigtwin.hardware.rig_operation import ARMED, LOOKING, SETTLING, Update
from rigtwin.hardware.session.own_controller import OwnController
from rigtwin.hardware.session.record import record_at_leisure
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.test import Test
from rigtwin.recording import load
from rigtwin.recording.reader import transitions
from rigtwin.simulation.experiment import Experiment
from rigtwin.system import STOP_SIGNALS, limit_files, raise_signal

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
    """What is put into one session.

    Parameters
    ----------
    kind : FaultKind
        What breaks.
    experiment : str
        Name of the test.
    at : int
        Tick of the card from which it is there.
    place : int
        Input or output that has it.
    seed : int
        Of the demands, the sensors' noise and the fault's own chance.
    """

    kind: FaultKind
    experiment: str
    at: int
    place: int
    seed: int


@dataclass(frozen=True)
class FaultResult:
    """What became of a session with a fault.

    Parameters
    ----------
    fault : Fault
        What was put into it.
    late : int or None
        Ticks from when the fault could be seen to safe outputs; None if it never could and the
        test was completed.
    from_start : int
        Ticks from the fault to safe outputs.
    exceeded : float
        Greatest true position, travel or force, as a share of its limit.
    cause, reason : str
        As the recording says.
    right : bool
        Whether they name the fault.
    readable : bool
        Whether the recording can be read to its last tick.
    """

    fault: Fault
    late: int | None
    from_start: int
    exceeded: float
    cause: str
    reason: str
    right: bool
    readable: bool

    @property
    def ok(self) -> bool:
        """Whether the session was stopped as it must be."""
        in_time = self.late is None or self.late <= 5
        return in_time and self.exceeded <= 1.1 and self.right and self.readable


def draw_faults(count: int, seed: int, kinds: Sequence[FaultKind] = KINDS) -> list[Fault]:
    """Draws faults: the kinds in turn, everything else at random.

    Parameters
    ----------
    count : int
        How many.
    seed : int
        Same seed, same faults.
    kinds : sequence of FaultKind
        From which they are taken.

    Returns
    -------
    list of Fault
        In the order of the kinds.
    """
    random = np.random.default_rng(seed)
    moving, ending = 1000.0 * (LOOKING + ARMED), BEFORE + 1000.0 * DURATION
    faults = []
    for number in range(count):
        kind = kinds[number % len(kinds)]
        place = int(random.integers(4)) if kind.place == "sensor" else int(random.integers(2))
        experiment = EXPERIMENTS[int(random.integers(len(EXPERIMENTS)))]
        of_controller = kind.place in ("controller", "loop") or kind.name == "controller hangs"
        first = BEFORE if of_controller else moving
        # A process on a slowed card takes its time: its faults come in the ramp or soon after.
        last = min(ending, BEFORE + SOON) if kind.place == "process" else ending
        at = int(random.uniform(first + 20.0, last - 50.0))
        faults.append(Fault(kind, experiment, at, place, int(random.integers(2**31))))
    return faults


def plan_test(fault: Fault, experiment: Experiment, table: ChannelTable) -> Test:
    """Gives the session that is to have a fault.

    Parameters
    ----------
    fault : Fault
        Its seed is the session's.
    experiment : Experiment
        The one that the fault names.
    table : ChannelTable
        Of the virtual card.

    Returns
    -------
    Test
        The experiment cut to DURATION and RAMP.
    """
    changes = {"timing": {"duration": DURATION}, "safety": {"ramp": RAMP}}
    configuration = override(experiment.configuration, changes)
    demands = experiment.demands(configuration, fault.seed)
    return Test(fault.experiment, configuration, demands, fault.seed, table)


def count_card_ticks(test: Test) -> int:
    """Counts the ticks that a session may take, and some more."""
    return len(test.demands) + 4000


class _GlitchingCard(VirtualCard):
    """Refuses an output once, or is disconnected, when its time has come."""

    glitch: tuple[str, int] = ("", 0)

    def answer(self, call: str, request: Message, response: Response) -> Message:
        kind, at = self.glitch
        if kind and self.tick >= at:
            if kind == "card disconnected":
                self.disconnect()
            elif call == "WriteAnalogF64":
                self.glitch = ("", 0)
                raise DriverError(BAD_VALUE, "the output was refused")
        return super().answer(call, request, response)


def try_fault(
    fault: Fault,
    experiment: Experiment,
    table: ChannelTable,
    folder: Path,
    own: OwnController | None = None,
) -> FaultResult:
    """Runs a session with one fault in this process.

    Parameters
    ----------
    fault : Fault
        Of any place but a process.
    experiment : Experiment
        The one that the fault names.
    table : ChannelTable
        Of the virtual card.
    folder : Path
        Where the recording goes.
    own : OwnController, optional
        One's own instead of the rig's.

    Returns
    -------
    FaultResult
        What became of it.

    Raises
    ------
    RigtwinError
        Only if the session could not even begin.
    KeyboardInterrupt
        If an operator ended it who is none of the fault.
    """
    test = replace(plan_test(fault, experiment, table), own=own)
    period, name = test.configuration.timing.period, fault.kind.name
    bench = FaultyBench(
        test.terminals(),
        table,
        kind=name,
        at=fault.at,
        place=fault.place,
        seed=fault.seed,
        ticks=count_card_ticks(test),
    )
    virtual = _GlitchingCard(bench, table, OnDemand())
    if fault.kind.place == "card":
        virtual.glitch = (name, fault.at)
    card = Card(table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    path, stop_file = folder / f"{fault.seed}.mcap", folder / f"{fault.seed}.stop"
    interrupted: list[str] = []
    with _full_disk(path) as fill, stop_requests(stop_file) as find_request:

        def stop() -> str | None:
            asked = find_request()
            if asked is not None and (fault.kind.place != "operator" or virtual.tick < fault.at):
                # Somebody at the keyboard, who means the campaign and not this session.
                interrupted.append(asked)
                return asked
            if virtual.tick >= fault.at:
                if name == "operator's signal" and virtual.tick == fault.at:
                    raise_signal(STOP_SIGNALS[fault.seed % 3])
                elif name == "operator's file":
                    stop_file.touch()
                elif name == "full disk":
                    fill()
            return find_request()

        def show_full_disk(_: int) -> None:
            if name == "full disk" and virtual.tick >= fault.at and bench.shown < 0:
                bench.shown = virtual.tick

        fails = fault.kind.place in ("controller", "loop")
        updating = test.updating()
        if fails:
            updating = _make_failing_update(fault, virtual, updating)
        try:
            record_at_leisure(card, test, path, stop, show_full_disk, test.operation(updating))
        except RigtwinError:
            if not interrupted:
                raise
    stop_file.unlink(missing_ok=True)
    if interrupted:
        raise KeyboardInterrupt(interrupted[0])
    return judge(fault, test, bench, path)


def _make_failing_update(fault: Fault, card: VirtualCard, healthy: Update) -> Update:
    """Makes a controller, or the loop around it, fail in its time.

    Before the test at its first tick.
    """

    def update(
        controlling: Controller, state: State, measured: Measurements, demand: Demand
    ) -> tuple[State, Commands]:
        state, commands = healthy(controlling, state, measured, demand)
        if card.tick < fault.at:
            return state, commands
        if fault.kind.name == "controller exception":
            raise ZeroDivisionError("float division by zero")
        if fault.kind.name == "command not a number":
            return state, commands._replace(**{("structure", "voltage")[fault.place]: float("nan")})
        if fault.kind.name == "command jumps":
            if fault.place == 0:
                return state, commands._replace(structure=commands.structure + 0.05)
            return state, commands._replace(voltage=commands.voltage - 11.0)
        card.run_until(card.tick + SLOW)
        return state, commands

    return update


@contextmanager
def _full_disk(path: Path) -> Iterator[Callable[[], None]]:
    """Gives a function after which the system lets no file grow any more."""
    with limit_files() as limit:
        yield lambda: limit(path.stat().st_size)


def judge(fault: Fault, test: Test, bench: FaultyBench, path: Path) -> FaultResult:
    """Judges a session by the log of its terminals and by its recording.

    Parameters
    ----------
    fault : Fault
        What was put into it.
    test : Test
        What was run.
    bench : FaultyBench
        The terminals.
    path : Path
        The recording.

    Returns
    -------
    FaultResult
        Its numbers in ticks of the card.
    """
    cause, reason = last_words(path)
    safe = bench.find_safe_tick()
    harmless = cause == "completed"
    shown = fault.at if fault.kind.everywhere else bench.shown
    late = None if harmless and shown < 0 else safe - (shown if shown >= 0 else safe)
    named = (
        fault.kind.place != "sensor"
        or cause not in ("jump", "stuck", "not_a_number")
        or SIGNALS[fault.place] in reason
    )
    right = named and (cause in fault.kind.causes or (harmless and shown < 0))
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


def last_words(path: Path) -> tuple[str, str]:
    """Reads cause and reason of a recording's last transition, empty where it has none."""
    found = transitions(path)
    return (found[-1]["cause"], found[-1]["reason"]) if found else ("", "")


def is_readable(path: Path) -> bool:
    """Says whether a recording can be read as far as it goes.

    One that ended before the test began has nothing but its states.
    """
    try:
        recording = load(path)
    except RigtwinError as error:
        return "no ticks" in str(error) and bool(last_words(path)[0])
    return bool(np.all(np.isfinite(recording.time)))
