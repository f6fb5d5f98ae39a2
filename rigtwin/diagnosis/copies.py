"""Recordings with the same content.

A copy among the fitted recordings would count the same noise twice and make every result look more
certain. A copy among the held-out recordings would judge a correction by the data of its fit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest


def digest(recording: RecordedTest) -> str:
    """Compute a digest of a recording's columns.

    Parameters
    ----------
    recording
        Recording whose columns are read.

    Returns
    -------
    str
        SHA-256 digest. It is independent of the file's name and date.
    """
    content = hashlib.sha256()
    # Topics and columns are sorted, as a copy may list them in another order.
    for topic, columns in sorted(recording.columns.items()):
        for name, values in sorted(columns.items()):
            content.update(f"{topic}.{name}".encode())
            content.update(np.ascontiguousarray(values, float).tobytes())
    return content.hexdigest()


def drop_copies(recordings: Sequence[RecordedTest]) -> tuple[list[RecordedTest], list[str]]:
    """Keep one recording of each content.

    Parameters
    ----------
    recordings
        Recordings fitted jointly.

    Returns
    -------
    tuple
        Recordings without copies, in their order, and a note for each copy.
    """
    distinct: dict[str, RecordedTest] = {}
    notes = []
    for recording in recordings:
        first = distinct.setdefault(digest(recording), recording)
        if first is not recording:
            notes.append(
                f"{recording.path.name} holds the same data as {first.path.name}; left out"
            )
    return list(distinct.values()), notes


def refuse_copies(held_out: Sequence[RecordedTest], fitted: Sequence[RecordedTest]) -> None:
    """Refuse held-out recordings whose data are those of the fit.

    Parameters
    ----------
    held_out
        Recordings that judge a correction.
    fitted
        Recordings that the correction is fitted to.

    Raises
    ------
    RigtwinError
        If a held-out recording has the same content as a fitted one.
    """
    by_digest = {digest(recording): recording for recording in fitted}
    for recording in held_out:
        copied = by_digest.get(digest(recording))
        if copied is not None:
            raise RigtwinError(
                f"{recording.path} cannot judge the correction: it holds the same data as "
                f"{copied.path}, which is fitted; expected a recording of another test"
            )
