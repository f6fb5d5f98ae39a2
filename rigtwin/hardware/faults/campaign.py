"""Campaign of sessions on the virtual card, where each has one fault at a random time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from google.protobuf.message import Message

from controllers import Commands, Controller, Demand, Measurements, MilState
from rigtwin.description.changes import override
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.transport import InProcess
from rigtwin.hardware.daq.virtual import BAD_VALUE, DriverError, OnDemand, Response, VirtualCard
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.kinds import KINDS, SIGNALS, FaultKind
from rigtwin.hardware.rig_operation import ARMED, LOOKING, SETTLING, Update
from rigtwin.hardware.session.custom_controller import CustomController
from rigtwin.hardware.session.record import record_unpaced
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.test import Test
from rigtwin.recording import load
from rigtwin.recording.reader import transitions
from rigtwin.simulation.experiment import Experiment
from rigtwin.system import STOP_SIGNALS, limit_files, raise_signal

EXPERIMENTS = ("drop", "road1.6", "semi-active", "imposed", "imposed-fast")
"""Experiments of the campaign, both model-in-the-loop and imposed tests."""
DURATION = 3.0
"""Duration of each test, in s. The fault comes at a random time of the ramp or the test."""
RAMP = 0.6
"""Duration of the ramp, in s."""
BEFORE = round(1000.0 * (LOOKING + ARMED + RAMP + SETTLING))
"""Number of ticks of the card before the test."""
SOON = 600
"""Number of ticks after the start within which a fault of a process comes."""
SLOW = 5
"""Number of ticks that pass during a slow one."""


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


def draw_faults(count: int, seed: int, kinds: Sequence[FaultKind] = KINDS) -> list[InjectedFault]:
    """Draw faults: the kinds in turn, everything else at random.

    Parameters
    ----------
    count : int
        Number of faults.
    seed : int
        Seed of the draw; equal seeds give equal faults.
    kinds : sequence of FaultKind
        Kinds that faults are drawn from.

    Returns
    -------
    list of InjectedFault
        Faults in the order of the kinds.
    """
    random = np.random.default_rng(seed)
    moving, ending = 1000.0 * (LOOKING + ARMED), BEFORE + 1000.0 * DURATION
    faults = []
    for number in range(count):
        # The kinds take turns, so that each is tried equally often.
        kind = kinds[number % len(kinds)]
        place = int(random.integers(4)) if kind.place == "sensor" else int(random.integers(2))
        experiment = EXPERIMENTS[int(random.integers(len(EXPERIMENTS)))]
        of_controller = kind.place in ("controller", "loop") or kind.name == "controller hangs"
        first = BEFORE if of_controller else moving
        # A process on a slowed card takes long, so its faults come in the ramp or soon after.
        last = min(ending, BEFORE + SOON) if kind.place == "process" else ending
        at = int(random.uniform(first + 20.0, last - 50.0))
        faults.append(InjectedFault(kind, experiment, at, place, int(random.integers(2**31))))
    return faults


def plan_test(fault: InjectedFault, experiment: Experiment, table: ChannelTable) -> Test:
    """Return the session that is to have a fault.

    Parameters
    ----------
    fault : Fault
        Fault, whose seed is also the session's.
    experiment : Experiment
        Experiment that the fault names.
    table : ChannelTable
        Channel table of the virtual card.

    Returns
    -------
    Test
        Experiment shortened to DURATION and RAMP.
    """
    changes = {"timing": {"duration": DURATION}, "safety": {"ramp": RAMP}}
    configuration = override(experiment.configuration, changes)
    demands = experiment.demands(configuration, fault.seed)
    return Test(fault.experiment, configuration, demands, fault.seed, table)


def count_card_ticks(test: Test) -> int:
    """Return an upper bound on the ticks of a session."""
    return len(test.demands) + 4000


class _GlitchingCard(VirtualCard):
    """Virtual card that refuses an output once, or is disconnected, at a given tick."""

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
    fault: InjectedFault,
    experiment: Experiment,
    table: ChannelTable,
    folder: Path,
    controller: CustomController | None = None,
) -> FaultResult:
    """Run a session with one fault in this process.

    Parameters
    ----------
    fault : InjectedFault
        Fault of any place but a process.
    experiment : Experiment
        Experiment that the fault names.
    table : ChannelTable
        Channel table of the virtual card.
    folder : Path
        Folder of the recording.
    controller : CustomController, optional
        Controller in place of the rig's.

    Returns
    -------
    FaultResult
        Result of the session.

    Raises
    ------
    RigtwinError
        If the session could not begin.
    KeyboardInterrupt
        If a real operator ended the campaign.
    """
    test = replace(plan_test(fault, experiment, table), controller=controller)
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
    # Time is the virtual card's, so results do not depend on this computer's speed.
    card = Card(table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    path, stop_file = folder / f"{fault.seed}.mcap", folder / f"{fault.seed}.stop"
    interrupted: list[str] = []
    with _full_disk(path) as fill, stop_requests(stop_file) as find_request:
        stop = _make_stop(fault, virtual, stop_file, fill, find_request, interrupted)

        def show_full_disk(_: int) -> None:
            if name == "full disk" and virtual.tick >= fault.at and bench.shown < 0:
                bench.shown = virtual.tick

        updating = test.updating()
        if fault.kind.place in ("controller", "loop"):
            updating = _make_failing_update(fault, virtual, updating)
        try:
            record_unpaced(card, test, path, stop, show_full_disk, test.operation(updating))
        except RigtwinError:
            # An interruption before the rig was armed is an error of the session, not of the fault.
            if not interrupted:
                raise
    stop_file.unlink(missing_ok=True)
    if interrupted:
        raise KeyboardInterrupt(interrupted[0])
    return judge(fault, test, bench, path)


def _make_stop(
    fault: InjectedFault,
    card: VirtualCard,
    stop_file: Path,
    fill: Callable[[], None],
    find_request: Callable[[], str | None],
    interrupted: list[str],
) -> Callable[[], str | None]:
    """Return the session's stop function, which also injects faults of operator and disk.

    A request that is not the fault's comes from a real operator; it is added to `interrupted`.
    """
    name = fault.kind.name

    def stop() -> str | None:
        asked = find_request()
        if asked is not None and (fault.kind.place != "operator" or card.tick < fault.at):
            # A real operator wants to end the campaign, not only this session.
            interrupted.append(asked)
            return asked
        if card.tick >= fault.at:
            if name == "operator's signal" and card.tick == fault.at:
                raise_signal(STOP_SIGNALS[fault.seed % 3])
            elif name == "operator's file":
                stop_file.touch()
            elif name == "full disk":
                fill()
        return find_request()

    return stop


def _make_failing_update(fault: InjectedFault, card: VirtualCard, healthy: Update) -> Update:
    """Return an update function of a controller, or of its loop, that fails from a tick on."""

    def update(
        controlling: Controller, state: MilState, measured: Measurements, demand: Demand
    ) -> tuple[MilState, Commands]:
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
        # Time passes on the card as if the loop had been busy.
        card.run_until(card.tick + SLOW)
        return state, commands

    return update


@contextmanager
def _full_disk(path: Path) -> Iterator[Callable[[], None]]:
    """Provide a function after which the system lets no file grow."""
    with limit_files() as limit:
        yield lambda: limit(path.stat().st_size)


def judge(fault: InjectedFault, test: Test, bench: FaultyBench, path: Path) -> FaultResult:
    """Judge a session by the log at its terminals and by its recording.

    Parameters
    ----------
    fault : Fault
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
