"""Export of recordings: CSV with a header and units, and MATLAB v5 files."""

from __future__ import annotations

import csv
import re
from io import BytesIO, StringIO
from pathlib import Path

import numpy as np
from scipy.io import savemat

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
from rigtwin.recording.channels import channels_of
from rigtwin.recording.recorded_test import RecordedTest

SHORT, LONGEST = 31, 55
"""Number of characters of a name that every MATLAB reads, and the maximum. A unit's name has its
topic in front, and MATLAB allows 63 characters in total."""
MATLAB_NAME = re.compile(rf"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST - 1}}}")


def export(recording: RecordedTest, path: Path) -> None:
    """Write every channel to a file whose format follows its suffix, .csv or .mat.

    Raises
    ------
    RigtwinError
        If the suffix is another, or the file cannot be written.
    """
    writers = {".csv": _csv, ".mat": _mat}
    if path.suffix.lower() not in writers:
        raise RigtwinError(
            f"cannot export to {path.name!r}: the name must end in {' or '.join(writers)}"
        )
    atomic_write(path, writers[path.suffix.lower()](recording))


def _csv(recording: RecordedTest) -> bytes:
    channels = channels_of(recording.columns, recording.machine)
    names = ["time", *(f"{channel.topic[1:]}.{channel.name}" for channel in channels)]
    units = ["s", *(channel.unit for channel in channels)]
    table = np.column_stack(
        [recording.time, *(recording.column(c.topic, c.name) for c in channels)]
    )
    written = StringIO()
    # The csv module quotes names with commas; savetxt would write them bare.
    csv.writer(written, lineterminator="\n").writerows([names, units])
    # 15 digits are the most that every decimal text survives as a double.
    np.savetxt(written, table, fmt="%.15g", delimiter=",")
    return written.getvalue().encode()


def _mat(recording: RecordedTest) -> bytes:
    for channel in recording.columns.values():
        for name in channel:
            # MATLAB cannot read a field of such a name.
            if not MATLAB_NAME.fullmatch(name):
                raise RigtwinError(
                    f"channel {name!r:.60} cannot be a field in MATLAB: expected at most "
                    f"{LONGEST} letters, digits and _ behind a letter; export to .csv"
                )
    content: dict[str, object] = {
        "time": recording.time,
        "period": recording.period,
        "experiment": recording.experiment,
    }
    for topic, values in recording.columns.items():
        content[topic[1:]] = dict(values)
    units = {
        f"{channel.topic[1:]}_{channel.name}": channel.unit
        for channel in channels_of(recording.columns, recording.machine)
    }
    content["units"] = {name: unit for name, unit in units.items()}
    written = BytesIO()
    # Names beyond 31 characters need a flag that older MATLAB cannot read, so it is set on demand.
    longest = max(map(len, units), default=0)
    savemat(written, content, oned_as="column", long_field_names=longest > SHORT)
    return written.getvalue()
