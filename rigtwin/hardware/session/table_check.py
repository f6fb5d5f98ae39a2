"""Check of a channel table on the card: readings at rest, and responses of inputs to outputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.calibration import (
    FORCE,
    RestReading,
    fit_responses,
    measure_rest,
    plan_bumps,
)
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.driver import require_client
from rigtwin.hardware.daq.table import OUTPUTS, ChannelTable, Plausible
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard
from rigtwin.hardware.session.record import open_card, record_in_real_time, record_unpaced
from rigtwin.hardware.session.test import Test
from rigtwin.hardware.supervisor import COMPLETED
from rigtwin.recording import load

LEAST_STROKE, MOST_STROKE = 0.001, 0.02
"""Range of a plate's motion in a sign check, in m: well above noise, well within any rig."""


def open_rig(table: ChannelTable, wiring: ChannelTable | None) -> Card:
    """Open a table's card, or a virtual one with another wiring. Raise RigtwinError if it fails."""
    period = Configuration().timing.period
    if wiring is None:
        return open_card(table, period)
    require_client()
    from rigtwin.hardware.daq.transport import InProcess

    virtual = VirtualCard(Terminals(Configuration(), wiring, 0), wiring, OnDemand())
    card = Card(table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card


def look_at_rest(table: ChannelTable, wiring: ChannelTable | None) -> tuple[RestReading, ...]:
    """Return the readings of every input while nothing moves.

    Parameters
    ----------
    table
        Channel table of the card.
    wiring
        True meaning of a volt on a virtual card; None for the real card.

    Raises
    ------
    RigtwinError
        If an input repeats one reading, because it is stuck or not connected.
    """
    rig = open_rig(table, wiring)
    try:
        rig.start()
        still = measure_rest(rig)
    finally:
        rig.stop()
    for signal in still:
        # Noise makes every working sensor change from tick to tick.
        if signal.repeats >= table.plausible.stuck:
            raise RigtwinError(
                f"{signal.name} gave {signal.repeats} times the same reading: "
                "stuck or not connected"
            )
    return still


def move_outputs(
    table: ChannelTable, wiring: ChannelTable | None, stroke: float, stop: Callable[[], str | None]
) -> dict[str, tuple[str, float, float]]:
    """Move every output a little, one after another, under supervision.

    Parameters
    ----------
    table
        Channel table before the check.
    wiring
        True meaning of a volt on a virtual card; None for the real card.
    stroke
        Motion of the plates, in m.
    stop
        Function that returns a reason to stop, or None.

    Returns
    -------
    dict
        Responses of the inputs to the outputs, as `fit_responses` returns them.

    Raises
    ------
    RigtwinError
        If the motion was stopped, or ticks were missed.
    """
    rig = open_rig(table, wiring)
    configuration, demands = plan_bumps(stroke, FORCE, Configuration().timing.period)
    # Signals of unknown sign cannot be compared with each other; their own limits still hold.
    alone = replace(table, plausible=Plausible(stuck=table.plausible.stuck, wheel=1e9, motor=1e9))
    test = Test("sign check", configuration, demands, 0, alone)
    with TemporaryDirectory(prefix="rigtwin-check-") as folder:
        path = Path(folder) / "check.mcap"
        if wiring is None:
            ended = record_in_real_time(rig, test, path, stop, guarded=True)
        else:
            ended = record_unpaced(rig, test, path, stop)
        if ended.cause != COMPLETED:
            raise RigtwinError(f"the check was stopped: {ended.cause.reason}")
        recording = load(path)
    # A missed tick would shift the responses against the demands.
    if recording.ticks != len(demands):
        raise RigtwinError(
            f"{len(demands) - recording.ticks} ticks were missed; do it again, "
            "with less else on this computer"
        )
    measured = np.column_stack([recording.column("/sensor", line.name) for line in table.inputs])
    return fit_responses(measured, demands)


def direction_of_wiring(output: str, table: ChannelTable, wiring: ChannelTable) -> int:
    """Return the direction, 1 or −1, in which an output of a virtual card moves."""
    place = OUTPUTS.index(output)
    return int(table.outputs[place].scaling.sign * wiring.outputs[place].scaling.sign)
