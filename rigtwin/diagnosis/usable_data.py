"""Recordings that can be diagnosed, and the answer for those that cannot."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.answer import Answer
from rigtwin.diagnosis.copies import drop_copies, refuse_copies
from rigtwin.diagnosis.data_checks import SHORTEST, find_faults
from rigtwin.diagnosis.short_recordings import drop_short, least_ticks
from rigtwin.diagnosis.standstill import describe_standstill, find_standstill
from rigtwin.recording import RecordedTest


def answer_unusable(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    configurations: Sequence[Configuration],
    started: float,
) -> Answer | None:
    """Answer for recordings that cannot be diagnosed.

    Parameters
    ----------
    machine
        Machine that was recorded.
    recordings
        Recordings fitted jointly.
    configurations
        Configuration of the twin for each recording.
    started
        Time at which the diagnosis began, s, by `time.perf_counter`.

    Returns
    -------
    Answer or None
        Answer that says why. None where the recordings can be diagnosed.
    """
    # The standstill is asked for first: the data checks would call a sensor dead that rightly saw
    # no motion.
    return _answer_standstill(machine, recordings, started) or _answer_faults(
        machine, recordings, configurations, started
    )


def _answer_faults(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    configurations: Sequence[Configuration],
    started: float,
) -> Answer | None:
    """Answer for recordings with a fault that forbids a diagnosis; None where there is none."""
    faults = [
        f"{recording.path}: {fault.message}"
        for recording, configuration in zip(recordings, configurations, strict=True)
        for fault in find_faults(machine, recording, configuration, least_ticks(recordings))
        if fault.fatal
    ]
    # A set may consist of short recordings; together they must be as long as a single one.
    total = sum(recording.ticks for recording in recordings)
    if len(recordings) > 1 and total < SHORTEST:
        faults.insert(
            0, f"the recordings have {total} ticks together; a diagnosis needs at least {SHORTEST}"
        )
    if not faults:
        return None
    return Answer(
        verdict="unusable",
        sentence=f"The data cannot be diagnosed: {faults[0]}.",
        faults=tuple(faults),
        notes=recording_notes(recordings),
        recordings=tuple(str(recording.path) for recording in recordings),
        seconds=time.perf_counter() - started,
        machine=machine.name,
    )


def _answer_standstill(
    machine: Machine, recordings: Sequence[RecordedTest], started: float
) -> Answer | None:
    """Answer for recordings in which nothing moved; None where something did."""
    standing = find_standstill(machine, recordings)
    if not standing:
        return None
    return Answer(
        verdict="unknown",
        sentence=describe_standstill(machine, standing),
        notes=recording_notes(recordings),
        recordings=tuple(str(recording.path) for recording in recordings),
        seconds=time.perf_counter() - started,
        machine=machine.name,
    )


def recording_notes(recordings: Sequence[RecordedTest]) -> tuple[str, ...]:
    """Return the notes that the reader made of recordings, with the names of their files."""
    names: dict[str, list[str]] = {}
    for recording in recordings:
        for note in recording.notes:
            names.setdefault(note, []).append(recording.path.name)
    # The tests of one log share their notes.
    return tuple(
        f"{files[0]}{f' and {len(files) - 1} more' if len(files) > 1 else ''}: {note}"
        for note, files in names.items()
    )


def drop_unneeded(
    recordings: Sequence[RecordedTest], held_out: Sequence[RecordedTest]
) -> tuple[list[RecordedTest], list[RecordedTest], list[str]]:
    """Leave out copies and recordings that are too short.

    Parameters
    ----------
    recordings
        Recordings fitted jointly.
    held_out
        Recordings that judge the correction.

    Returns
    -------
    tuple
        Recordings and held-out recordings that remain, and a note for each that is left out.

    Raises
    ------
    RigtwinError
        If a held-out recording has the same content as a fitted one.
    """
    # Copies go before short recordings: with one of two left, the stricter limits of a single
    # recording apply.
    distinct, notes = drop_copies(recordings)
    refuse_copies(held_out, distinct)
    fitted, short = drop_short(distinct)
    judging, short_held_out = drop_short(held_out)
    return fitted, judging, [*notes, *short, *short_held_out]
