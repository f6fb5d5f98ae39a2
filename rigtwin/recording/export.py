"""Recordings for other programs: CSV with a header and units, and MATLAB v5 files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import savemat

from rigtwin.errors import RigtwinError
from rigtwin.recording.channels import channels_of
from rigtwin.recording.reader import Recording


def export(recording: Recording, path: Path) -> None:
    """Writes every channel; the kind follows the name's ending, .csv or .mat.

    Raises RigtwinError for any other.
    """
    writers = {".csv": _csv, ".mat": _mat}
    if path.suffix.lower() not in writers:
        raise RigtwinError(
            f"cannot export to {path.name!r}: the name must end in {' or '.join(writers)}"
        )
    try:
        writers[path.suffix.lower()](recording, path)
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


def _csv(recording: Recording, path: Path) -> None:
    there = channels_of(recording.columns)
    names = ["time", *(f"{channel.topic[1:]}.{channel.name}" for channel in there)]
    units = ["s", *(channel.unit for channel in there)]
    table = np.column_stack([recording.time, *(recording.column(c.topic, c.name) for c in there)])
    header = ",".join(names) + "\n" + ",".join(units)
    np.savetxt(path, table, fmt="%.15g", delimiter=",", header=header, comments="")


def _mat(recording: Recording, path: Path) -> None:
    content: dict[str, object] = {
        "time": recording.time,
        "period": recording.period,
        "experiment": recording.experiment,
    }
    for topic, values in recording.columns.items():
        content[topic[1:]] = dict(values)
    units = {
        f"{channel.topic[1:]}_{channel.name}": channel.unit
        for channel in channels_of(recording.columns)
    }
    content["units"] = {name: unit for name, unit in units.items()}
    savemat(path, content, oned_as="column")
