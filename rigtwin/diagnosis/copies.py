"""Recordings with the same content: a copy adds nothing to a fit, and is no held-out data."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.recording import Recording


def digest(recording: Recording) -> str:
    """Compute a digest of a recording's columns.

    Parameters
    ----------
    recording
        The recording.

    Returns
    -------
    str
        The same for two recordings of the same data, whatever their names and times.
    """
    content = hashlib.sha256()
    for topic, columns in sorted(recording.columns.items()):
        for name, values in sorted(columns.items()):
            content.update(f"{topic}.{name}".encode())
            content.update(np.ascontiguousarray(values, float).tobytes())
    return content.hexdigest()


def drop_copies(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Keep one recording of each content.

    Parameters
    ----------
    recordings
        Recordings that are explained together.

    Returns
    -------
    tuple
        The recordings without copies, in their order, and a note for each copy.
    """
    kept: dict[str, Recording] = {}
    notes = []
    for recording in recordings:
        first = kept.setdefault(digest(recording), recording)
        if first is not recording:
            notes.append(
                f"{recording.path.name} holds the same data as {first.path.name}; left out"
            )
    return list(kept.values()), notes


def refuse_copies(held_out: Sequence[Recording], fitted: Sequence[Recording]) -> None:
    """Refuse held-out recordings whose data are those of the fit.

    Parameters
    ----------
    held_out
        Recordings that a correction is judged on.
    fitted
        Recordings that it is fitted to.

    Raises
    ------
    RigtwinError
        If one of them has the same content as one of the fit.
    """
    known = {digest(recording): recording for recording in fitted}
    for recording in held_out:
        same = known.get(digest(recording))
        if same is not None:
            raise RigtwinError(
                f"{recording.path} cannot judge the correction: it holds the same data as "
                f"{same.path}, which is fitted; expected a recording of another test"
            )
