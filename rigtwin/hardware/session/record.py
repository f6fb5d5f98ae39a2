"""Records a supervised session.

On the card, on its virtual copy, or on the twin behind the card's converters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rigtwin import __version__
from rigtwin.description.configuration import flatten
from rigtwin.hardware.daq.card import Card, connect, require_client
from rigtwin.hardware.daq.table import to_toml
from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard
from rigtwin.hardware.daq.wired import Wired
from rigtwin.hardware.operation import Operation
from rigtwin.hardware.realtime import Lateness, Pacer, describe_grants, in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.guardian_settings import GuardianSettings
from rigtwin.hardware.session.recorder import Keeper
from rigtwin.hardware.session.test import AnyTest
from rigtwin.hardware.supervision import SessionEnd, supervise
from rigtwin.recording import Writer, twin_values
from rigtwin.recording.schema import CARD_RECORD, LATENESS_RECORD, TWIN_RECORD
from rigtwin.simulation.rig import DrivenRig

LONGEST = 1.0
"""s that a guardian waits for a tick at most, however many may be missed."""


def open_virtual_card(test: AnyTest, terminals: Wired | None = None) -> tuple[Card, VirtualCard]:
    """Opens a virtual card in this process, behind the unmodified nidaqmx client.

    Parameters
    ----------
    test : AnyTest
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

    period = test.period
    virtual = VirtualCard(terminals or test.terminals(), test.table, OnDemand())
    card = Card(test.table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card, virtual


def metadata(test: AnyTest, virtual: bool) -> dict[str, dict[str, str]]:
    """Says what a recording holds beyond the test: the channel table, and how a twin made it."""
    told = {CARD_RECORD: {"table": to_toml(test.table)}}
    if virtual:
        settings = flatten(test.configuration)
        told[TWIN_RECORD] = twin_values(test.seed, settings, test.effects, __version__)
    return told


def _writer_of(path: Path, test: AnyTest) -> Callable[[], Writer]:
    """What opens the recording, here or in another process."""
    return partial(
        Writer,
        path,
        test.experiment,
        test.period,
        controller=test.controller_settings,
        machine=test.machine_name,
        fields=test.layout.fields,
        description=test.description,
    )


def record_at_leisure(
    rig: DrivenRig,
    test: AnyTest,
    path: Path,
    stop: Callable[[], str | None] = lambda: None,
    progress: Callable[[int], object] = lambda _: None,
    operation: Operation | None = None,
) -> SessionEnd:
    """Records on a twin whose time waits for the loop, as fast as it goes.

    Parameters
    ----------
    rig : DrivenRig
        The twin, or a virtual card.
    test : AnyTest
        What is to be done.
    path : Path
        Of the recording.
    stop : callable
        Called in every tick; a text stops the session and is its reason.
    progress : callable
        Called with the ticks done since its last call.
    operation : Operation, optional
        The test's by default.

    Returns
    -------
    SessionEnd
        How it ended.

    Raises
    ------
    RigtwinError
        Before anything is recorded.
    """
    operation = operation or test.operation()
    with _writer_of(path, test)() as writer:
        writer.reserve()
        for name, values in metadata(test, virtual=True).items():
            writer.add_metadata(name, values)
        keeper = Keeper(writer, test.layout)
        ended = supervise(rig, operation, keeper, stop, progress=progress)
        writer.finish(ended.cause.reason)
    return ended


def guardian_settings(
    test: AnyTest,
    path: Path,
    guarded: bool,
    notes: Sequence[tuple[str, dict[str, str]]] = (),
    live: int = 0,
) -> GuardianSettings:
    """Gives what a guardian has to know of a test.

    Parameters
    ----------
    test : AnyTest
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
    operation = test.operation()
    # The last tick that may be late comes `missed` + 1 periods after the one before, and a bit.
    patience = min((operation.missed + 1.5) * test.period, LONGEST)
    told = metadata(test, virtual=not guarded) | dict(notes)
    return GuardianSettings(
        _writer_of(path, test),
        metadata=told,
        layout=test.layout,
        table=test.table if guarded else None,
        patience=patience,
        hold=operation.course.hold,
        live=live,
    )


def record_in_real_time(
    rig: DrivenRig,
    test: AnyTest,
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
    test : AnyTest
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
    operation = test.operation()
    course = operation.course
    whole = operation.ticks + round(2.0 * (course.ramp + course.hold + 1.0) / operation.period)
    lateness = Lateness(whole)
    guardian = Guardian(guardian_settings(test, path, guarded, notes, live))
    with ExitStack() as stack:
        grants = stack.enter_context(in_real_time(fifo))
        try:
            ended = supervise(rig, operation, guardian, stop, lateness, progress)
        except BaseException as error:
            guardian.finish(f"not run: {' '.join(str(error).split())}")
            raise
    guardian.add_metadata(LATENESS_RECORD, lateness.record(describe_grants(grants)))
    guardian.finish(ended.cause.reason)
    return ended


def open_card(test: AnyTest) -> Card:
    """Opens the card itself and inspects it. Raises CardFault; moves nothing."""
    period = test.period
    channel = connect(test.table.address)
    pacer = Pacer(period) if test.table.timing == "software" else None
    card = Card(test.table, period, channel, pacer=pacer)
    card.inspect()
    return card
