"""Whether a test may be run on the rig: a table that somebody answers for, a card that is there,
and a dry run of just this session."""

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
    """card: on which nothing has moved yet; notes: what the recording has to say of it."""

    card: Card
    notes: tuple[tuple[str, dict[str, str]], ...]


def key_of(test: AnyTest) -> str:
    """By which a dry run of just this session is known."""
    told = test.experiment if test.own is None else f"{test.experiment} by {test.own.told}"
    return digest(told, test.configuration, test.list_demands(), test.table)


def require_permission(test: AnyTest, card: Path, without_dry_run: str | None) -> Permission:
    """What a test needs to be run on the rig.

    Parameters
    ----------
    test
        The session.
    card
        Its channel table; dry runs are listed beside it.
    without_dry_run
        Who answers for leaving the dry run out, if it is.

    Raises
    ------
    RigtwinError
        If the test must not be run.
    """
    if test.effects:
        raise RigtwinError("--effect is the twin's; the rig has its own")
    require_trust(test.table, date.today())
    test.operation()
    test.require_limits()
    opened = open_card(test)
    if has_passed(card, key_of(test)):
        return Permission(opened, ())
    if not without_dry_run:
        raise RigtwinError(
            f"{test.experiment} with these settings has had no dry run; do it first: "
            "the same command with --dry-run "
            "(or say who answers for it: --without-dry-run NAME)"
        )
    note = ("rigtwin.override", {"dry run": f"left out by {without_dry_run}"})
    return Permission(opened, (note,))


def list_obstacles(test: AnyTest) -> tuple[str, ...]:
    """What would keep a test off the machine besides its dry run, a line each."""
    lacking = list_doubts(test.table, date.today())
    for look in (test.require_limits, lambda: open_card(test)):
        try:
            look()
        except RigtwinError as error:
            lacking.append(str(error))
    return tuple(lacking)
