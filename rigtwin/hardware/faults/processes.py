"""Faults of the whole controller process: killed, frozen, hanging.

The card is behind a socket, its clock runs, and a guardian watches; only its word counts.
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

from controllers import Commands, Controller, Demand, Measurements, State
from controllers import update as healthy
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card, connect
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.transport import LOCAL, serve
from rigtwin.hardware.daq.virtual import RealTime, VirtualCard
from rigtwin.hardware.faults.bench import FaultyBench
from rigtwin.hardware.faults.campaign import (
    BEFORE,
    Fault,
    FaultResult,
    count_card_ticks,
    judge,
    last_words,
    plan_test,
)
from rigtwin.hardware.realtime import in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.record import guardian_settings
from rigtwin.hardware.session.test import Test
from rigtwin.hardware.supervision import supervise
from rigtwin.simulation.experiment import Experiment
from rigtwin.system import freeze_process, kill_process, monotonic

DILATION = 8.0
"""By how much the card's clock is slowed: a call through a socket takes most of a millisecond, a
tick needs three, and this computer may be doing other things. Ticks are counted, not seconds."""
TIMES = 6
COMING = 60.0
"""s within which the controller process must have reached its fault."""


class Stray(RigtwinError):
    """The guardian stopped the rig before the fault came: this computer kept the loop waiting."""

    def __init__(self) -> None:
        super().__init__(
            "this computer is too busy: "
            "the loop was kept waiting and the rig stopped before its fault came"
        )


def try_process_fault(
    fault: Fault, experiment: Experiment, table: ChannelTable, folder: Path
) -> FaultResult:
    """Runs a session whose controller process has a fault.

    A session that a busy computer has cut short is begun anew, a few times.

    Parameters
    ----------
    fault : Fault
        Of a process.
    experiment : Experiment
        The one that the fault names.
    table : ChannelTable
        Of the virtual card.
    folder : Path
        Where the recording goes.

    Returns
    -------
    FaultResult
        What became of it.

    Raises
    ------
    RigtwinError
        If the fault could not be put into any of the sessions.
    """
    test = plan_test(fault, experiment, table)
    for _ in range(TIMES):
        with suppress(Stray):
            return _try_once(fault, test, folder)
    raise Stray


def _try_once(fault: Fault, test: Test, folder: Path) -> FaultResult:
    table, period, ticks = test.table, test.configuration.timing.period, count_card_ticks(test)
    bench = FaultyBench(
        test.terminals(), table, kind="", at=ticks, place=0, seed=fault.seed, ticks=ticks
    )
    clock = RealTime(DILATION * period)
    virtual = VirtualCard(bench, table, clock)
    server, port = serve(virtual, 0)
    reached = replace(table, address=f"{LOCAL}:{port}")
    path = folder / f"{fault.seed}.mcap"
    context = multiprocessing.get_context("spawn")
    hung = context.Value("d", 0.0)
    arguments = (replace(test, table=reached), path, fault, hung)
    controller = context.Process(target=_control, args=arguments, name="rigtwin controller")
    try:
        controller.start()
        at = clock.tick_at(_strike(controller, virtual, fault, hung))
        _wait_until(lambda: not virtual.power, "the power to be taken off")
        _wait_until(lambda: _has_ended(path), "the recording to be ended")
        virtual.run_until(virtual.tick + 1)
    finally:
        controller.kill()
        controller.join()
        server.stop(0.0).wait()
    return judge(replace(fault, at=at), test, bench, path)


def _strike(
    controller: BaseProcess, virtual: VirtualCard, fault: Fault, hung: Synchronized[float]
) -> float:
    """Strikes when the card's time has come; returns the moment, s of `monotonic`.

    The card's time begins with the session.
    """
    if fault.kind.name == "controller hangs":
        _wait_until(
            lambda: hung.value > 0.0 or controller.exitcode is not None, "the controller to hang"
        )
        if hung.value == 0.0:
            raise Stray
        return float(hung.value)
    _wait_until(
        lambda: virtual.tick >= fault.at or controller.exitcode is not None,
        "the session to get there",
    )
    if controller.exitcode is not None:
        raise Stray
    assert controller.pid is not None
    deadly = {"process killed": kill_process, "process frozen": freeze_process}
    deadly[fault.kind.name](controller.pid)
    return monotonic()


def _wait_until(there: Callable[[], bool], what: str) -> None:
    end = monotonic() + COMING
    while not there():
        if monotonic() > end:
            raise RigtwinError(f"waited {COMING:g} s for {what}")
        time.sleep(5e-4)


def _has_ended(path: Path) -> bool:
    return last_words(path)[0] == "process"


def _control(test: Test, path: Path, fault: Fault, hung: Synchronized[float]) -> None:
    """The controller process: everything slowed as the card is.

    What it and its guardian have to say is in the recording.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    period, channel = test.configuration.timing.period, connect(test.table.address)
    card = Card(test.table, period, channel, clock=_read_slow_clock)
    usual = guardian_settings(test, path, guarded=True)
    guardian = Guardian(
        replace(usual, patience=DILATION * usual.patience, hold=DILATION * usual.hold)
    )
    ticks = 0

    def hang(
        controlling: Controller, state: State, measured: Measurements, demand: Demand
    ) -> tuple[State, Commands]:
        nonlocal ticks
        ticks += 1
        if fault.kind.name == "controller hangs" and ticks > fault.at - BEFORE:
            hung.value = monotonic()
            while True:
                pass
        return healthy(controlling, state, measured, demand)

    with in_real_time():
        supervise(card, test.operation(hang), guardian)
    guardian.finish("completed")


def _read_slow_clock() -> float:
    return monotonic() / DILATION
