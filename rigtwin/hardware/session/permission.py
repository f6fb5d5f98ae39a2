"""Permission to run a test on the rig: a trusted channel table, a card, and a matching dry run."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table import list_doubts, require_trust
from rigtwin.hardware.session.dry_run import digest, has_passed
from rigtwin.hardware.session.record import open_card
from rigtwin.hardware.session.test import AnyTest


@dataclass(frozen=True)
class Permission:
    """Permission to run a test.

    Attributes
    ----------
    card
        Card on which nothing has moved yet.
    notes
        Metadata records that the recording must contain.
    """

    card: Card
    notes: tuple[tuple[str, dict[str, str]], ...]


def key_of(test: AnyTest) -> str:
    """Return the key by which dry runs of a session are listed."""
    title = test.experiment
    if test.controller is not None:
        title = f"{title} by {test.controller.identity}"
    return digest(title, test.configuration, test.list_demands(), test.table)


def require_permission(test: AnyTest, card: Path, without_dry_run: str | None) -> Permission:
    """Return the permission to run a test on the rig.

    Parameters
    ----------
    test
        Test of the session.
    card
        Path of the channel table. The list of dry runs is beside it.
    without_dry_run
        Name of the person who takes responsibility for a missing dry run; None to require one.

    Raises
    ------
    RigtwinError
        If the test must not be run.
    """
    # Checks go from cheap to expensive; opening the card comes last, when all else is in order.
    if test.effects:
        raise RigtwinError("--effect is the twin's; the rig has its own")
    require_trust(test.table, date.today())
    # Built only to be checked: it raises an error if a limit exceeds what a line can carry.
    test.operation()
    test.require_limits()
    opened = open_card(test.table, test.period)
    if has_passed(card, key_of(test)):
        return Permission(opened, ())
    # A missing dry run is possible, but somebody's name stands for it in the recording.
    if not without_dry_run:
        raise RigtwinError(
            f"{test.experiment} with these settings has had no dry run; do it first: the same "
            "command with --dry-run (or say who answers for it: --without-dry-run NAME)"
        )
    note = ("rigtwin.override", {"dry run": f"left out by {without_dry_run}"})
    return Permission(opened, (note,))


def list_obstacles(test: AnyTest) -> tuple[str, ...]:
    """Return what prevents a test on the machine besides a missing dry run, one per line."""
    lacking = list_doubts(test.table, date.today())
    for look in (test.require_limits, lambda: open_card(test.table, test.period)):
        try:
            look()
        except RigtwinError as error:
            lacking.append(str(error))
    return tuple(lacking)
