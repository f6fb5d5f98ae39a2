"""The dry run: the exact session on the virtual card first.

What it predicts, and the list of what has passed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from rigtwin.description.configuration import Configuration, flatten
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import ChannelTable, to_toml


def digest(told: str, configuration: Configuration, demands: bytes, table: ChannelTable) -> str:
    """Computes a key of all that makes a session another one.

    Parameters
    ----------
    told : str
        The experiment's name, and what else is told of it in words.
    configuration : Configuration
        Every setting.
    demands : bytes
        What is demanded.
    table : ChannelTable
        Of the card.

    Returns
    -------
    str
        SHA-256, in hexadecimal.
    """
    known = json.dumps([told, flatten(configuration), to_toml(table)], sort_keys=True)
    return hashlib.sha256(known.encode() + demands).hexdigest()


def ledger(card: Path) -> Path:
    """Where the dry runs of a card are listed: beside its channel table."""
    return card.with_suffix(".dry-runs.json")


def has_passed(card: Path, key: str) -> bool:
    """Whether that session has had a dry run which completed.

    Raises RigtwinError for a list that cannot be read.
    """
    return key in _entries(ledger(card))


def enter(card: Path, key: str, entry: Mapping[str, str]) -> None:
    """Adds a dry run that completed. Raises RigtwinError."""
    path = ledger(card)
    entries = {**_entries(path), key: dict(entry)}
    temporary = path.with_suffix(".json.new")
    try:
        temporary.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


def _entries(path: Path) -> dict[str, dict[str, str]]:
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
