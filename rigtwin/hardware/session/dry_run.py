"""List of dry runs: sessions that completed on the virtual card before they run on the rig."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from rigtwin.description.configuration import Configuration, flatten
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.table_file import to_toml


def digest(title: str, configuration: Configuration, demands: bytes, table: ChannelTable) -> str:
    """Return a key that identifies a session.

    Parameters
    ----------
    title : str
        Name of the experiment, and the identity of a custom controller.
    configuration : Configuration
        All settings.
    demands : bytes
        Demands of the test.
    table : ChannelTable
        Channel table of the card.

    Returns
    -------
    str
        SHA-256 digest in hexadecimal.
    """
    # Sorted keys make the digest independent of the order of settings.
    known = json.dumps([title, flatten(configuration), to_toml(table)], sort_keys=True)
    return hashlib.sha256(known.encode() + demands).hexdigest()


def ledger(card: Path) -> Path:
    """Return the path of a card's list of dry runs, beside its channel table."""
    return card.with_suffix(".dry-runs.json")


def has_passed(card: Path, key: str) -> bool:
    """Return whether a session has completed a dry run.

    Raises
    ------
    RigtwinError
        If the list cannot be read.
    """
    return key in _entries(ledger(card))


def add_dry_run(card: Path, key: str, entry: Mapping[str, str]) -> None:
    """Add a completed dry run to the list. Raise RigtwinError if it cannot be written."""
    path = ledger(card)
    # An entry of the same session is renewed; all others stay.
    entries = {**_entries(path), key: dict(entry)}
    # The list is replaced as a whole, so that a crash leaves the old one intact.
    temporary = path.with_suffix(".json.new")
    try:
        temporary.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


def _entries(path: Path) -> dict[str, dict[str, str]]:
    """Return the list of dry runs by key; empty if the file does not exist."""
    if not path.exists():
        return {}
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    except ValueError:
        raise RigtwinError(
            f"{path} is not a list of dry runs; remove it and do them again"
        ) from None
    if not isinstance(entries, dict):
        raise RigtwinError(f"{path} is not a list of dry runs; remove it and do them again")
    return entries
