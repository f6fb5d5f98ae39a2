"""Short recordings of a set.

They are judged together if the set as a whole is long enough. A recording that is too short even
as a part of a set is left out.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.diagnosis.data_checks import SHORTEST, SHORTEST_PART, SHORTEST_TIME
from rigtwin.recording import RecordedTest


def drop_short(recordings: Sequence[RecordedTest]) -> tuple[list[RecordedTest], list[str]]:
    """Leave out the recordings that are too short to be a part of a set.

    Parameters
    ----------
    recordings
        Recordings fitted jointly.

    Returns
    -------
    tuple
        The recordings that are long enough, in their order, and one note for each recording that
        is left out. A set in which none is long enough is returned whole, so that the data checks
        refuse it with their own message.
    """
    if len(recordings) < 2:
        return list(recordings), []
    long_enough, notes = [], []
    for recording in recordings:
        seconds = recording.ticks * recording.period
        if recording.ticks < SHORTEST_PART or seconds < SHORTEST_TIME:
            notes.append(
                f"{recording.path.name} is left out: it has {recording.ticks} ticks in "
                f"{seconds:.3g} s; a recording of a set needs at least {SHORTEST_PART} ticks and "
                f"{SHORTEST_TIME:g} s"
            )
        else:
            long_enough.append(recording)
    return (long_enough, notes) if long_enough else (list(recordings), [])


def least_ticks(recordings: Sequence[RecordedTest]) -> int:
    """Return the number of ticks that every recording of a set must have.

    Parameters
    ----------
    recordings
        Recordings fitted jointly.

    Returns
    -------
    int
        Ticks. A recording of a long set may be shorter than one that stands alone.
    """
    total = sum(recording.ticks for recording in recordings)
    return SHORTEST_PART if len(recordings) > 1 and total >= SHORTEST else SHORTEST
