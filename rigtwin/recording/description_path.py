"""Path of a machine's description, as a recording remembers it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

KEY = "description"
"""Key of the path in the metadata record that says what the test was."""
FARTHEST = 2
"""Number of folders above the recording within which a description belongs to the same project.
Its path is then stored relative to the recording, so that the project can be moved."""


def description_values(recording: Path, description: Path | None) -> dict[str, str]:
    """Return the metadata that remember a description.

    Parameters
    ----------
    recording
        File of the recording.
    description
        Description of its machine; None remembers nothing.

    Returns
    -------
    dict
        The path relative to the recording's folder, with slashes, if both belong to one project;
        else the absolute path.
    """
    if description is None:
        return {}
    target, folder = description.resolve(), recording.resolve().parent
    try:
        relative = Path(os.path.relpath(target, folder))
    except ValueError:
        # On Windows, files of two drives have no relative path.
        return {KEY: target.as_posix()}
    near = relative.parts.count(os.pardir) <= FARTHEST
    # Forward slashes, so that a recording made on Windows is found on Linux.
    return {KEY: (relative if near else target).as_posix()}


def description_of(recording: Path, values: Mapping[str, str]) -> Path | None:
    """Return the path of a description that metadata remember.

    Parameters
    ----------
    recording
        File of the recording.
    values
        Metadata of the recording.

    Returns
    -------
    Path or None
        The path, whether the file still exists or not; None if none is remembered.
    """
    # A zero byte would make the system's calls raise ValueError instead of finding no file.
    text = values.get(KEY, "")
    if not text or "\0" in text:
        return None
    # An absolute path stays as it is.
    return Path(os.path.normpath(recording.parent / text))
