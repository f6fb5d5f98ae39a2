"""Short recordings of a set: judged together if the set is long enough, left out if they say
nothing even then."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.diagnosis.data_checks import SHORTEST, SHORTEST_PART, SHORTEST_TIME
from rigtwin.recording import Recording


def drop_short(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Leave out recordings of a set that are too short to count.

    Parameters
    ----------
    recordings
        Recordings that are judged together.

    Returns
    -------
    tuple
        The recordings that are long enough, in their order, and a note for each other one. A set
        in which none is long enough is returned whole: it is for the data checks to refuse.
    """
    if len(recordings) < 2:
        return list(recordings), []
    kept, notes = [], []
    for recording in recordings:
        lasts = recording.ticks * recording.period
        if recording.ticks < SHORTEST_PART or lasts < SHORTEST_TIME:
            notes.append(
                f"{recording.path.name} is left out: it has {recording.ticks} ticks in {lasts:.3g} "
                f"s; a recording of a set needs at least {SHORTEST_PART} ticks and "
                f"{SHORTEST_TIME:g} s"
            )
        else:
            kept.append(recording)
    return (kept, notes) if kept else (list(recordings), [])


def least_ticks(recordings: Sequence[Recording]) -> int:
    """Return the number of ticks that each recording of a set must have: fewer where the set as a
    whole is long enough."""
    total = sum(recording.ticks for recording in recordings)
    return SHORTEST_PART if len(recordings) > 1 and total >= SHORTEST else SHORTEST
