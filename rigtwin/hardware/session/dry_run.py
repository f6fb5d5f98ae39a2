"""The dry run: the exact session on the virtual card first.

What it predicts, and the list of what has passed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from controllers import Commands, Measurements
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import ChannelTable, to_toml
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.simulation.peaks import Peak, peaks


def predict_peaks(recording: Recording, configuration: Configuration) -> tuple[Peak, ...]:
    """Predicts how near to every limit a session comes.

    Parameters
    ----------
    recording : Recording
        Of its dry run.
    configuration : Configuration
        With the limits.

    Returns
    -------
    tuple of Peak
        One for each limit.
    """
    commands = np.column_stack([recording.column("/command", name) for name in Commands._fields])
    measurements = np.column_stack(
        [recording.column("/sensor", name) for name in Measurements._fields]
    )
    return peaks(commands, measurements, configuration)


def digest(
    experiment: str, configuration: Configuration, demands: Array, table: ChannelTable
) -> str:
    """Computes a key of all that makes a session another one.

    Parameters
    ----------
    experiment : str
        Its name.
    configuration : Configuration
        Every setting.
    demands : Array
        Shape (ticks, 3).
    table : ChannelTable
        Of the card.

    Returns
    -------
    str
        SHA-256, in hexadecimal.
    """
    told = json.dumps([experiment, flatten(configuration), to_toml(table)], sort_keys=True)
    return hashlib.sha256(told.encode() + np.ascontiguousarray(demands).tobytes()).hexdigest()


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
