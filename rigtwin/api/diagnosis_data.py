"""Recordings of one machine, read from files or logs, that are diagnosed or fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigtwin.api.describing import describe, needs_description, record_logs
from rigtwin.api.machines import described_machine
from rigtwin.api.recordings import resolve_recording
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader

Recorded = reader.RecordedTest | str | Path | Any
"""A recording, the path of one, or a log in memory beside a model: a pandas DataFrame, an Arrow
table, a numpy array with named fields, or a dictionary of name → array."""


@dataclass(frozen=True)
class DiagnosisData:
    """Recordings of one machine.

    Attributes
    ----------
    machine : Machine
        Machine of all recordings.
    recordings : tuple of Recording
        Recordings to fit, at least one.
    held_out : tuple of Recording
        Recordings to judge on.
    """

    machine: Machine
    recordings: tuple[reader.RecordedTest, ...]
    held_out: tuple[reader.RecordedTest, ...]


def read_data(
    recordings: Recorded | Sequence[Recorded],
    machine: Machine | str | Path | None,
    held_out: Recorded | Sequence[Recorded],
    columns: Mapping[str, str] | None,
    test: str,
) -> DiagnosisData:
    """Read the recordings that `diagnose` and `fit` take.

    If the machine is a model, the recordings are logs: the first one describes the machine, and
    all are converted to recordings of it.

    Raises
    ------
    RigtwinError
        If there is no recording, one is named twice, or its machine is unknown.
    """
    logs = as_list(recordings)
    if needs_description(machine, logs):
        if not logs:
            raise RigtwinError("no recording to diagnose")
        # The first log decides on columns and units; the others must follow it to be comparable.
        described = describe(machine, logs[0], columns=columns, test=test)  # type: ignore[arg-type]
        recordings = record_logs(described, logs)
        held_out = record_logs(described, as_list(held_out))
        machine = described.machine
    elif columns or test:
        raise RigtwinError("columns and test describe a log; expected a model as the machine")
    fitted = [resolve_recording(recording) for recording in as_list(recordings)]
    judged = [resolve_recording(recording) for recording in as_list(held_out)]
    if not fitted:
        raise RigtwinError("no recording to diagnose")
    if has_duplicate([*fitted, *judged]):
        raise RigtwinError(
            "a recording is named twice; each counts once, and held-out data must not be fitted"
        )
    return DiagnosisData(described_machine(fitted[0], machine), tuple(fitted), tuple(judged))


def as_list(recordings: Recorded | Sequence[Recorded]) -> list[Recorded]:
    """Return one recording or several as a list.

    Parameters
    ----------
    recordings
        A recording, or a sequence of them.
    """
    if isinstance(recordings, Sequence) and not isinstance(recordings, str):
        return list(recordings)
    return [recordings]


def has_duplicate(recordings: Sequence[reader.RecordedTest]) -> bool:
    """Return whether two recordings are the same file; those in memory have none.

    Parameters
    ----------
    recordings
        Recordings, those to fit and those held out.
    """
    # Resolved, since links and relative paths may name one file twice.
    paths = [recording.path.resolve() for recording in recordings if recording.path.exists()]
    return len(set(paths)) < len(paths)
