"""Faults of the whole controller process: killed, frozen, hanging.

The card is behind a socket with a running clock, and a guardian watches. The verdict is based on
the guardian's recording alone.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

from controllers import Commands, Controller, Demand, Measurements, MilState
from controllers import update as healthy
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.driver import connect
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.transport import LOCAL, serve
from rigtwin.hardware.daq.virtual import RealTime, VirtualCard
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.campaign import BEFORE, count_card_ticks, plan_test
from rigtwin.hardware.faults.outcome import FaultResult, InjectedFault, judge, read_final_cause
from rigtwin.hardware.realtime import in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.record import guardian_settings
from rigtwin.hardware.session.test import Test
from rigtwin.hardware.supervision import supervise
from rigtwin.simulation.experiment import Experiment
from rigtwin.system import freeze_process, kill_process, monotonic

DILATION = 8.0
"""Factor by which the card's clock is slowed. A call through a socket takes most of a millisecond,
a tick needs three calls, and the computer may be busy. Results count ticks, not seconds."""
TIMES = 6
"""Maximum number of sessions per fault, if a busy computer cuts them short."""
COMING = 60.0
"""Time within which the controller process must reach its fault, in s."""


class FaultNotReached(RigtwinError):
    """Error if the guardian stopped the rig before the fault, because the computer was too busy."""

    def __init__(self) -> None:
        super().__init__(
            "this computer is too busy: "
            "the loop was kept waiting and the rig stopped before its fault came"
        )


def try_process_fault(
    fault: InjectedFault, experiment: Experiment, table: ChannelTable, folder: Path
) -> FaultResult:
    """Run a session whose controller process has a fault.

    A session that a busy computer cut short is repeated a few times.

    Parameters
    ----------
    fault : Fault
        Fault of a process.
    experiment : Experiment
        Experiment that the fault names.
    table : ChannelTable
        Channel table of the virtual card.
    folder : Path
        Folder of the recording.

    Returns
    -------
    FaultResult
        Result of the session.

    Raises
    ------
    RigtwinError
        If no session reached the fault.
    """
    test = plan_test(fault, experiment, table)
    for _ in range(TIMES):
        with suppress(FaultNotReached):
            return _try_once(fault, test, folder)
    raise FaultNotReached


def _try_once(fault: InjectedFault, test: Test, folder: Path) -> FaultResult:
    """Run one session. Raise FaultNotReached if it ended before the fault."""
    table, period, ticks = test.table, test.configuration.timing.period, count_card_ticks(test)
    bench = FaultyBench(
        test.terminals(), table, kind="", at=ticks, place=0, seed=fault.seed, ticks=ticks
    )
    clock = RealTime(DILATION * period)
    virtual = VirtualCard(bench, table, clock)
    server, port = serve(virtual, 0)
    reached = replace(table, address=f"{LOCAL}:{port}")
    path = folder / f"{fault.seed}.mcap"
    # A fresh process: a fork would inherit the card's server threads and their locks.
    context = multiprocessing.get_context("spawn")
    hung = context.Value("d", 0.0)
    arguments = (replace(test, table=reached), path, fault, hung)
    controller = context.Process(target=_control, args=arguments, name="rigtwin controller")
    try:
        controller.start()
        at = clock.tick_at(_inject(controller, virtual, fault, hung))
        _wait_until(lambda: not virtual.power, "the power to be taken off")
        _wait_until(lambda: _has_ended(path), "the recording to be ended")
        # One more tick logs the outputs that the guardian has set.
        virtual.run_until(virtual.tick + 1)
    finally:
        # SIGKILL, since a frozen process would not act on SIGTERM before it is continued.
        controller.kill()
        controller.join()
        server.stop(0.0).wait()
    return judge(replace(fault, at=at), test, bench, path)


def _inject(
    controller: BaseProcess, virtual: VirtualCard, fault: InjectedFault, hung: Synchronized[float]
) -> float:
    """Inject the fault when the card's time has come, and return that time of `monotonic` in s.

    The card's time begins with the session.
    """
    if fault.kind.name == "controller hangs":
        _wait_until(
            lambda: hung.value > 0.0 or controller.exitcode is not None, "the controller to hang"
        )
        # The process ended before its fault, so the attempt proves nothing.
        if hung.value == 0.0:
            raise FaultNotReached
        return float(hung.value)
    _wait_until(
        lambda: virtual.tick >= fault.at or controller.exitcode is not None,
        "the session to get there",
    )
    if controller.exitcode is not None:
        raise FaultNotReached
    assert controller.pid is not None
    deadly = {"process killed": kill_process, "process frozen": freeze_process}
    deadly[fault.kind.name](controller.pid)
    return monotonic()


def _wait_until(condition: Callable[[], bool], event: str) -> None:
    end = monotonic() + COMING
    while not condition():
        if monotonic() > end:
            raise RigtwinError(f"waited {COMING:g} s for {event}")
        time.sleep(5e-4)


def _has_ended(path: Path) -> bool:
    return read_final_cause(path)[0] == "process"


def _control(test: Test, path: Path, fault: InjectedFault, hung: Synchronized[float]) -> None:
    """Run the controller process, slowed down as the card is.

    Messages of the process and its guardian are discarded; the recording has them.
    """
    # The process and its guardian report the fault on standard error, which is expected here.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    period, channel = test.configuration.timing.period, connect(test.table.address)
    card = Card(test.table, period, channel, clock=_read_slow_clock)
    usual = guardian_settings(test, path, guarded=True)
    guardian = Guardian(
        # The guardian's patience is slowed down by the same factor as the card.
        replace(usual, patience=DILATION * usual.patience, hold=DILATION * usual.hold)
    )
    ticks = 0

    def hang(
        controlling: Controller, state: MilState, measured: Measurements, demand: Demand
    ) -> tuple[MilState, Commands]:
        nonlocal ticks
        ticks += 1
        if fault.kind.name == "controller hangs" and ticks > fault.at - BEFORE:
            hung.value = monotonic()
            # A busy loop, not a sleep: the guardian must notice a process that uses its core.
            while True:
                pass
        return healthy(controlling, state, measured, demand)

    with in_real_time():
        supervise(card, test.operation(hang), guardian)
    guardian.finish("completed")


def _read_slow_clock() -> float:
    return monotonic() / DILATION
