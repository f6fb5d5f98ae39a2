"""Faults of the whole controller process: killed, frozen, hang. The card is behind a socket, its clock runs, and a guardian
watches; only its word counts."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

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
from rigtwin.hardware.realtime import in_real_time, monotonic
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.record import Test, guardian_settings
from rigtwin.hardware.supervision import supervise

DILATION = 8.0
"""By how much the card's clock is slowed: a call through a socket takes most of a millisecond, a tick needs three, and this
computer may be doing other things. Ticks are counted, not seconds."""
TIMES = 6
COMING = 60.0
"""s within which the controller process must have reached its fault."""


class Stray(RigtwinError):
    """The guardian stopped the rig before the fault came: this computer kept the loop waiting for longer than it may wait."""

    def __init__(self) -> None:
        super().__init__(
            "this computer is too busy: the loop was kept waiting and the rig stopped before its fault came"
        )


def try_process_fault(fault: Fault, table: ChannelTable, folder: Path) -> FaultResult:
    """One such fault. A session that a busy computer has cut short is begun anew, a few times. Raises RigtwinError."""
    for _ in range(TIMES):
        with suppress(Stray):
            return _try_once(fault, table, folder)
    raise Stray


def _try_once(fault: Fault, table: ChannelTable, folder: Path) -> FaultResult:
    test = plan_test(fault, table)
    period = test.configuration.timing.period
    bench = FaultyBench(test.terminals(), table, "", count_card_ticks(test), 0, fault.seed, count_card_ticks(test))
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
        _wait_until(lambda: not virtual.pressure, "the pressure to be taken off")
        _wait_until(lambda: _has_ended(path), "the recording to be ended")
        virtual.run_until(virtual.tick + 1)
    finally:
        controller.kill()
        controller.join()
        server.stop(0.0).wait()
    return judge(replace(fault, at=at), test, bench, path)


def _strike(controller: Any, virtual: VirtualCard, fault: Fault, hung: Any) -> float:
    """Strikes when the card's time has come; returns the moment. The card's time begins with the session."""
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
    os.kill(
        controller.pid,
        {"process killed": signal.SIGKILL, "process frozen": signal.SIGSTOP}[fault.kind.name],
    )
    return monotonic()


def _wait_until(there: Any, what: str) -> None:
    end = monotonic() + COMING
    while not there():
        if monotonic() > end:
            raise RigtwinError(f"waited {COMING:g} s for {what}")
        time.sleep(5e-4)


def _has_ended(path: Path) -> bool:
    return last_words(path)[0] == "process"


def _control(test: Test, path: Path, fault: Fault, hung: Any) -> None:
    """The controller process: everything slowed as the card is. What it and its guardian have to say is in the recording."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    card = Card(
        test.table, test.configuration.timing.period, connect(test.table.address), clock=_read_slow_clock
    )
    patient = guardian_settings(test, path, True)
    guardian = Guardian(
        replace(patient, patience=DILATION * patient.patience, hold=DILATION * patient.hold)
    )
    ticks = 0

    def hang(controlling: Any, state: Any, measured: Any, demand: Any) -> Any:
        nonlocal ticks
        ticks += 1
        if fault.kind.name == "controller hangs" and ticks > fault.at - BEFORE:
            hung.value = monotonic()
            while True:
                pass
        return healthy(controlling, state, measured, demand)

    with in_real_time():
        supervise(card, test.card_configuration, test.demands, guardian, updating=hang)
    guardian.finish("completed")


def _read_slow_clock() -> float:
    return monotonic() / DILATION
