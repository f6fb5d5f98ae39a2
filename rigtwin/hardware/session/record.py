"""Recording of a supervised session on the card, its virtual copy, or the twin behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rigtwin import __version__
from rigtwin.description.configuration import flatten
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.driver import connect, require_client
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.table_file import to_toml
from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard
from rigtwin.hardware.daq.wired import Wired
from rigtwin.hardware.operation import Operation
from rigtwin.hardware.realtime import Lateness, Pacer, describe_grants, in_real_time
from rigtwin.hardware.session.guardian import Guardian
from rigtwin.hardware.session.guardian_settings import GuardianSettings
from rigtwin.hardware.session.recorder import SessionRecorder
from rigtwin.hardware.session.test import AnyTest
from rigtwin.hardware.supervision import SessionEnd, supervise
from rigtwin.recording import Writer, twin_values
from rigtwin.recording.schema import CARD_RECORD, LATENESS_RECORD, TWIN_RECORD
from rigtwin.simulation.rig import DrivenRig

LONGEST = 1.0
"""Longest time a guardian waits for a tick, in s, however many ticks may be missed."""


def open_virtual_card(test: AnyTest, terminals: Wired | None = None) -> tuple[Card, VirtualCard]:
    """Open a virtual card in this process, behind the unmodified nidaqmx client.

    Parameters
    ----------
    test : AnyTest
        Test whose period, table and, by default, twin are used.
    terminals : Wired, optional
        Rig at the card's terminals.

    Returns
    -------
    tuple of Card and VirtualCard
        Client's card, and the virtual card behind it.

    Raises
    ------
    RigtwinError
        If the client is missing, or a limit exceeds a line's range.
    """
    require_client()
    from rigtwin.hardware.daq.transport import InProcess

    # The clock of the client's card is the virtual card's: it advances with each sample.
    period = test.period
    virtual = VirtualCard(terminals or test.terminals(), test.table, OnDemand())
    card = Card(test.table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card, virtual


def metadata(test: AnyTest, virtual: bool) -> dict[str, dict[str, str]]:
    """Return the metadata of a recording: the channel table, and how a twin made it."""
    records = {CARD_RECORD: {"table": to_toml(test.table)}}
    if virtual:
        settings = flatten(test.configuration)
        records[TWIN_RECORD] = twin_values(test.seed, settings, test.effects, __version__)
    return records


def _writer_of(path: Path, test: AnyTest) -> Callable[[], Writer]:
    """Return a picklable function that opens the recording in this or another process."""
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


def record_unpaced(
    rig: DrivenRig,
    test: AnyTest,
    path: Path,
    stop: Callable[[], str | None] = lambda: None,
    progress: Callable[[int], object] = lambda _: None,
    operation: Operation | None = None,
) -> SessionEnd:
    """Record on a twin whose time waits for the loop, as fast as possible.

    Parameters
    ----------
    rig : DrivenRig
        Twin or virtual card.
    test : AnyTest
        Test of the session.
    path : Path
        Path of the recording.
    stop : callable
        Function called in every tick; a text it returns stops the session and is the reason.
    progress : callable
        Function called with the number of ticks since its last call.
    operation : Operation, optional
        Operation of the test. Defaults to the test's own.

    Returns
    -------
    SessionEnd
        End of the session.

    Raises
    ------
    RigtwinError
        If the session cannot begin; nothing is recorded then.
    """
    operation = operation or test.operation()
    with _writer_of(path, test)() as writer:
        # Space is reserved first, so that a full disk cannot prevent the last records.
        writer.reserve()
        for name, values in metadata(test, virtual=True).items():
            writer.add_metadata(name, values)
        recorder = SessionRecorder(writer, test.layout)
        ended = supervise(rig, operation, recorder, stop, progress=progress)
        writer.finish(ended.cause.reason)
    return ended


def guardian_settings(
    test: AnyTest,
    path: Path,
    guarded: bool,
    notes: Sequence[tuple[str, dict[str, str]]] = (),
    live: int = 0,
) -> GuardianSettings:
    """Return the guardian's settings for a test.

    Parameters
    ----------
    test : AnyTest
        Test of the session.
    path : Path
        Path of the recording.
    guarded : bool
        Whether the rig is a card that the guardian must be able to stop.
    notes : sequence of (str, dict)
        Further metadata records.
    live : int
        Port of a live view; 0 for none.

    Returns
    -------
    GuardianSettings
        Settings, which are picklable.
    """
    operation = test.operation()
    # The last tick that may be late comes `missed` + 1 periods after its predecessor; half a period
    # is added for jitter.
    patience = min((operation.missed + 1.5) * test.period, LONGEST)
    records = metadata(test, virtual=not guarded) | dict(notes)
    return GuardianSettings(
        _writer_of(path, test),
        metadata=records,
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
    """Record in real time, with a guardian process.

    Parameters
    ----------
    rig : DrivenRig
        Card, or twin in real time.
    test : AnyTest
        Test of the session.
    path : Path
        Path of the recording.
    stop : callable
        Function called in every tick; a text it returns stops the session and is the reason.
    guarded : bool
        Whether the rig is a card that the guardian must stop if this process dies.
    notes : sequence of (str, dict)
        Further metadata records.
    live : int
        Port of a live view; 0 for none.
    progress : callable
        Function called with the number of ticks since its last call.
    fifo : bool
        Whether to request real-time scheduling.

    Returns
    -------
    SessionEnd
        End of the session.

    Raises
    ------
    RigtwinError
        If the session cannot begin; nothing has moved then.
    """
    operation = test.operation()
    lateness = Lateness(_count_ticks(operation))
    # The guardian starts before this process takes real-time priority, which it would inherit.
    guardian = Guardian(guardian_settings(test, path, guarded, notes, live))
    with ExitStack() as stack:
        grants = stack.enter_context(in_real_time(fifo))
        try:
            ended = supervise(rig, operation, guardian, stop, lateness, progress)
        # The guardian must not outlive the session, whatever ended it.
        except BaseException as error:
            guardian.finish(f"not run: {' '.join(str(error).split())}")
            raise
    guardian.add_metadata(LATENESS_RECORD, lateness.record(describe_grants(grants)))
    guardian.finish(ended.cause.reason)
    return ended


def _count_ticks(operation: Operation) -> int:
    """Return an upper bound on a session's ticks: the statistics' memory must not grow later."""
    course = operation.course
    # Both ramps and the hold, with a second to spare.
    return operation.ticks + round(2.0 * (course.ramp + course.hold + 1.0) / operation.period)


def open_card(table: ChannelTable, period: float) -> Card:
    """Open the card and inspect it. Raise CardFault; nothing moves."""
    # A card without its own clock is paced by this computer.
    pacer = Pacer(period) if table.timing == "software" else None
    card = Card(table, period, connect(table.address), pacer=pacer)
    card.inspect()
    return card
