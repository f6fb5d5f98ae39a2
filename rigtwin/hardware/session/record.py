"""Records a supervised session: on the card, on its virtual copy, or on the twin behind the card's converters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controllers import update
from rigtwin import __version__
from rigtwin.description.configuration import Configuration, apply_effects, flatten
from rigtwin.hardware.daq.card import Card, connected, require_client
from rigtwin.hardware.daq.table import ChannelTable, fit, written
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard, Wired
from rigtwin.hardware.realtime import Lateness, Pacer, described, in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.recorder import Keeper
from rigtwin.hardware.session.watched import Watched
from rigtwin.hardware.supervised import Ended, Update, supervise
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer, twin_values
from rigtwin.recording.schema import CARD_RECORD, LATENESS_RECORD, TWIN_RECORD
from rigtwin.simulation.rig import DrivenRig

LONGEST = 1.0
"""s that a guardian waits for a tick at most, however many may be missed."""


@dataclass(frozen=True)
class Test:
    """What is to be done. demands: shape (ticks, 3); effects: of the twin, as `--effect` takes them; none on a real rig."""

    __test__ = False  # not one of pytest's

    experiment: str
    configuration: Configuration
    demands: Array
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()

    @property
    def limited(self) -> Configuration:
        """With the limits that the card's table adds. Raises RigtwinError where a limit does not fit the card's lines."""
        fit(self.table, self.configuration.safety)
        return self.configuration._replace(safety=self.table.of(self.configuration.safety))

    def terminals(self) -> Terminals:
        """The twin at the card's terminals, wired as the table says."""
        return Terminals(apply_effects(self.configuration, list(self.effects)), self.table, self.seed)


def on_virtual_card(test: Test, terminals: Wired | None = None) -> tuple[Card, VirtualCard]:
    """The card backend on a virtual card in this process: the unmodified nidaqmx client, volts both ways."""
    require_client()
    from rigtwin.hardware.daq.transport import InProcess

    period = test.configuration.timing.period
    virtual = VirtualCard(terminals or test.terminals(), test.table, OnDemand())
    card = Card(test.table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card, virtual


def metadata(test: Test, virtual: bool) -> dict[str, dict[str, str]]:
    """What a recording says beyond the test: the channel table, and how a twin made it."""
    told = {CARD_RECORD: {"table": written(test.table)}}
    if virtual:
        told[TWIN_RECORD] = twin_values(test.seed, flatten(test.configuration), test.effects, __version__)
    return told


def _writing(path: Path, test: Test) -> dict[str, Any]:
    return {
        "path": path,
        "experiment": test.experiment,
        "period": test.configuration.timing.period,
        "controller": flatten(test.configuration)["controller"],
    }


def record_at_leisure(
    rig: DrivenRig,
    test: Test,
    path: Path,
    stop: Callable[[], str | None] = lambda: None,
    progress: Callable[[int], object] = lambda _: None,
    updating: Update = update,
) -> Ended:
    """On a twin whose time waits for the loop, as fast as it goes. Raises RigtwinError before anything is recorded."""
    limited = test.limited
    with Writer(**_writing(path, test)) as writer:
        writer.reserve()
        for name, values in metadata(test, virtual=True).items():
            writer.add_metadata(name, values)
        ended = supervise(rig, limited, test.demands, Keeper(writer), stop, updating=updating, progress=progress)
        writer.finish(ended.cause.reason)
    return ended


def watched(test: Test, path: Path, guarded: bool, notes: Sequence[tuple[str, dict[str, str]]] = (), live: int = 0) -> Watched:
    """What a guardian has to know of a test."""
    safety = test.configuration.safety
    # The last tick that may be late comes `missed` + 1 periods after the one before, and a little more.
    patience = min((safety.missed + 1.5) * test.configuration.timing.period, LONGEST)
    told = metadata(test, virtual=not guarded) | dict(notes)
    return Watched(_writing(path, test), told, test.table if guarded else None, patience, safety.hold, live)


def record_in_real_time(
    rig: DrivenRig,
    test: Test,
    path: Path,
    stop: Callable[[], str | None],
    guarded: bool,
    notes: Sequence[tuple[str, dict[str, str]]] = (),
    live: int = 0,
    progress: Callable[[int], object] = lambda _: None,
    fifo: bool = True,
) -> Ended:
    """In real time, with a guardian process. guarded: whether the rig is a card that the guardian has to stop if this process
    dies; notes: more metadata records. Raises RigtwinError before anything moves."""
    limited = test.limited
    safety, period = limited.safety, limited.timing.period
    whole = len(test.demands) + round(2.0 * (safety.ramp + safety.hold + 1.0) / period)
    lateness = Lateness(whole)
    guardian = Guardian(watched(test, path, guarded, notes, live))
    with ExitStack() as stack:
        grants = stack.enter_context(in_real_time(fifo))
        try:
            ended = supervise(rig, limited, test.demands, guardian, stop, lateness, progress=progress)
        except BaseException as error:
            guardian.finish(f"not run: {' '.join(str(error).split())}")
            raise
    guardian.add_metadata(LATENESS_RECORD, lateness.record(described(grants)))
    guardian.finish(ended.cause.reason)
    return ended


def on_card(test: Test) -> Card:
    """The card itself, inspected. Raises CardFault; moves nothing."""
    period = test.configuration.timing.period
    channel = connected(test.table.address)
    pacer = Pacer(period) if test.table.timing == "software" else None
    card = Card(test.table, period, channel, pacer=pacer)
    card.inspect()
    return card
