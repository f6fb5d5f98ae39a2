"""Records a supervised session.

On the card, on its virtual copy, or on the twin behind the card's converters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from controllers import update
from rigtwin import __version__
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.effects import apply_effects
from rigtwin.description.machine import OWN
from rigtwin.hardware.daq.card import Card, connect, require_client
from rigtwin.hardware.daq.table import ChannelTable, require_ranges, to_toml
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard, Wired
from rigtwin.hardware.realtime import Lateness, Pacer, describe_grants, in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.guardian_settings import GuardianSettings
from rigtwin.hardware.session.own_controller import OwnController, OwnUpdate
from rigtwin.hardware.session.recorder import Keeper
from rigtwin.hardware.supervision import SessionEnd, Update, supervise
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer, twin_values
from rigtwin.recording.schema import CARD_RECORD, LATENESS_RECORD, TWIN_RECORD
from rigtwin.simulation.rig import DrivenRig

LONGEST = 1.0
"""s that a guardian waits for a tick at most, however many may be missed."""


@dataclass(frozen=True)
class Test:
    """What is to be done.

    Parameters
    ----------
    experiment : str
        Its name.
    configuration : Configuration
        Of rig, controller and clocks.
    demands : Array
        Columns of controllers.Demand, shape (ticks, 3).
    seed : int
        Of the twin's noise.
    table : ChannelTable
        Of the card.
    effects : sequence of str
        Of the twin, as `--effect` takes them; none on a real rig.
    own : OwnController, optional
        One's own instead of the rig's.
    """

    __test__ = False  # not one of pytest's

    experiment: str
    configuration: Configuration
    demands: Array
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()
    own: OwnController | None = None

    @property
    def controller_settings(self) -> dict[str, Any]:
        """What a recording says of the controller: of one's own only where the test started."""
        told: dict[str, Any] = flatten(self.configuration)["controller"]
        if self.own is None:
            return told
        return {OWN: True, **{name: told[name] for name in ("start", "preload")}}

    def updating(self) -> Update:
        """The controller of one session."""
        return update if self.own is None else OwnUpdate(self.own, self.configuration)

    @property
    def card_configuration(self) -> Configuration:
        """The configuration with the limits that the card's table adds.

        Raises
        ------
        RigtwinError
            Where a limit does not fit the card's lines.
        """
        require_ranges(self.table, self.configuration.safety)
        return self.configuration._replace(safety=self.table.tighten(self.configuration.safety))

    def terminals(self) -> Terminals:
        """Builds the twin at the card's terminals, wired as the table says."""
        return Terminals(
            apply_effects(self.configuration, list(self.effects)), self.table, self.seed
        )


def open_virtual_card(test: Test, terminals: Wired | None = None) -> tuple[Card, VirtualCard]:
    """Opens a virtual card in this process, behind the unmodified nidaqmx client.

    Parameters
    ----------
    test : Test
        Its period, table and, by default, twin.
    terminals : Wired, optional
        What the card is wired to.

    Returns
    -------
    tuple of Card and VirtualCard
        The rig, and the card behind it.

    Raises
    ------
    RigtwinError
        If the client is missing or a limit does not fit the card.
    """
    require_client()
    from rigtwin.hardware.daq.transport import InProcess

    period = test.configuration.timing.period
    virtual = VirtualCard(terminals or test.terminals(), test.table, OnDemand())
    card = Card(test.table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card, virtual


def metadata(test: Test, virtual: bool) -> dict[str, dict[str, str]]:
    """Says what a recording holds beyond the test: the channel table, and how a twin made it."""
    told = {CARD_RECORD: {"table": to_toml(test.table)}}
    if virtual:
        told[TWIN_RECORD] = twin_values(
            test.seed, flatten(test.configuration), test.effects, __version__
        )
    return told


def _writer_of(path: Path, test: Test) -> Callable[[], Writer]:
    """What opens the recording, here or in another process."""
    return partial(
        Writer,
        path,
        test.experiment,
        test.configuration.timing.period,
        controller=test.controller_settings,
    )


def record_at_leisure(
    rig: DrivenRig,
    test: Test,
    path: Path,
    stop: Callable[[], str | None] = lambda: None,
    progress: Callable[[int], object] = lambda _: None,
    updating: Update | None = None,
) -> SessionEnd:
    """Records on a twin whose time waits for the loop, as fast as it goes.

    Parameters
    ----------
    rig : DrivenRig
        The twin, or a virtual card.
    test : Test
        What is to be done.
    path : Path
        Of the recording.
    stop : callable
        Called in every tick; a text stops the session and is its reason.
    progress : callable
        Called with the ticks done since its last call.
    updating : Update, optional
        The controller; the test's by default.

    Returns
    -------
    SessionEnd
        How it ended.

    Raises
    ------
    RigtwinError
        Before anything is recorded.
    """
    limited, updating = test.card_configuration, updating or test.updating()
    with _writer_of(path, test)() as writer:
        writer.reserve()
        for name, values in metadata(test, virtual=True).items():
            writer.add_metadata(name, values)
        ended = supervise(
            rig, limited, test.demands, Keeper(writer), stop, updating=updating, progress=progress
        )
        writer.finish(ended.cause.reason)
    return ended


def guardian_settings(
    test: Test,
    path: Path,
    guarded: bool,
    notes: Sequence[tuple[str, dict[str, str]]] = (),
    live: int = 0,
) -> GuardianSettings:
    """Gives what a guardian has to know of a test.

    Parameters
    ----------
    test : Test
        What is to be done.
    path : Path
        Of the recording.
    guarded : bool
        Whether the rig is a card that the guardian has to stop.
    notes : sequence of (str, dict)
        More metadata records.
    live : int
        Port of a live view, 0 for none.

    Returns
    -------
    GuardianSettings
        Picklable.
    """
    safety = test.configuration.safety
    # The last tick that may be late comes `missed` + 1 periods after the one before, and a bit.
    patience = min((safety.missed + 1.5) * test.configuration.timing.period, LONGEST)
    told = metadata(test, virtual=not guarded) | dict(notes)
    return GuardianSettings(
        _writer_of(path, test),
        metadata=told,
        table=test.table if guarded else None,
        patience=patience,
        hold=safety.hold,
        live=live,
    )


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
) -> SessionEnd:
    """Records in real time, with a guardian process.

    Parameters
    ----------
    rig : DrivenRig
        The card, or a twin in real time.
    test : Test
        What is to be done.
    path : Path
        Of the recording.
    stop : callable
        Called in every tick; a text stops the session and is its reason.
    guarded : bool
        Whether the rig is a card that the guardian has to stop if this process dies.
    notes : sequence of (str, dict)
        More metadata records.
    live : int
        Port of a live view, 0 for none.
    progress : callable
        Called with the ticks done since its last call.
    fifo : bool
        Whether to ask for the scheduling class of real time.

    Returns
    -------
    SessionEnd
        How it ended.

    Raises
    ------
    RigtwinError
        Before anything moves.
    """
    limited = test.card_configuration
    safety, period = limited.safety, limited.timing.period
    whole = len(test.demands) + round(2.0 * (safety.ramp + safety.hold + 1.0) / period)
    lateness = Lateness(whole)
    guardian = Guardian(guardian_settings(test, path, guarded, notes, live))
    with ExitStack() as stack:
        grants = stack.enter_context(in_real_time(fifo))
        try:
            ended = supervise(
                rig,
                limited,
                test.demands,
                guardian,
                stop,
                lateness,
                updating=test.updating(),
                progress=progress,
            )
        except BaseException as error:
            guardian.finish(f"not run: {' '.join(str(error).split())}")
            raise
    guardian.add_metadata(LATENESS_RECORD, lateness.record(describe_grants(grants)))
    guardian.finish(ended.cause.reason)
    return ended


def open_card(test: Test) -> Card:
    """Opens the card itself and inspects it. Raises CardFault; moves nothing."""
    period = test.configuration.timing.period
    channel = connect(test.table.address)
    pacer = Pacer(period) if test.table.timing == "software" else None
    card = Card(test.table, period, channel, pacer=pacer)
    card.inspect()
    return card
