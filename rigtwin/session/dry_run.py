"""The dry run: the exact session on the virtual card first. What it predicts, and the list of what has passed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigtwin.arrays import Array
from rigtwin.configuration import Configuration, flattened
from rigtwin.daq.table import ChannelTable, written
from rigtwin.errors import RigtwinError
from rigtwin.recording import Recording
from rigtwin.safety import VELOCITY_SPAN


@dataclass(frozen=True)
class Predicted:
    """One quantity of a session. peak and limit in the unit; margin: share of the limit that is left."""

    name: str
    peak: float
    limit: float
    unit: str

    @property
    def margin(self) -> float:
        return 1.0 - self.peak / self.limit


def predicted(recording: Recording, configuration: Configuration) -> tuple[Predicted, ...]:
    """Every limited quantity of a session that was recorded on the virtual card."""
    limits, period = configuration.safety, configuration.timing.period
    sensor = {name: recording.column("/sensor", name) for name in recording.columns["/sensor"]}
    command = {name: recording.column("/command", name) for name in recording.columns["/command"]}
    travel = sensor["suspension_lvdt"]
    span = min(VELOCITY_SPAN, len(travel) - 1)
    moved = np.abs(travel[span:] - travel[:-span]) / (span * period) if span else np.zeros(1)

    def peak(values: Array) -> float:
        return float(np.max(np.abs(values)))

    def rate(values: Array) -> float:
        return peak(np.diff(values)) / period if len(values) > 1 else 0.0

    volts = configuration.controller.voltage_limit
    return (
        Predicted("force", peak(sensor["load_cell"]), limits.force, "N"),
        Predicted("travel", peak(travel), limits.travel, "m"),
        Predicted("structure", peak(sensor["structure_lvdt"]), limits.structure, "m"),
        Predicted("ground", peak(sensor["ground_lvdt"]), limits.ground, "m"),
        Predicted("velocity of travel", float(moved.max()), limits.velocity, "m/s"),
        Predicted("voltage", peak(command["voltage"]), volts, "V"),
        Predicted("rate of the ground command", rate(command["ground"]), limits.command_rate, "m/s"),
        Predicted("rate of the structure command", rate(command["structure"]), limits.command_rate, "m/s"),
        Predicted("structure off its command", peak(command["structure"] - sensor["structure_lvdt"]), limits.following, "m"),
        Predicted("force off its demand", peak(command["force"] - sensor["load_cell"]), limits.following_force, "N"),
    )


def digest(experiment: str, configuration: Configuration, demands: Array, table: ChannelTable) -> str:
    """What makes a session another one: experiment, every setting, what is demanded, and the channel table."""
    told = json.dumps([experiment, flattened(configuration), written(table)], sort_keys=True)
    return hashlib.sha256(told.encode() + np.ascontiguousarray(demands).tobytes()).hexdigest()


def ledger(card: Path) -> Path:
    """Where the dry runs of a card are listed: beside its channel table."""
    return card.with_suffix(".dry-runs.json")


def passed(card: Path, key: str) -> bool:
    """Whether that session has had a dry run which completed. Raises RigtwinError for a list that cannot be read."""
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
        raise RigtwinError(f"{path} is not a list of dry runs; remove it and do them again") from None
    if not isinstance(entries, dict):
        raise RigtwinError(f"{path} is not a list of dry runs; remove it and do them again")
    return entries
