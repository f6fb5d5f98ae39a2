"""Arrays by name in a file of NumPy, npz."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format
from rigtwin.importing.frames import read_frame
from rigtwin.importing.selection import Selection


def read_archive(path: Path, selection: Selection) -> Columns:
    """Read the needed arrays of a file that `numpy.savez` wrote. Raises RigtwinError for any other
    file."""
    # np.load would take any other file for a pickle, and say so in its error.
    if not zipfile.is_zipfile(path) and path.is_file():
        raise RigtwinError(f"{path} is not an npz file")
    try:
        # allow_pickle=False, because loading a pickle runs code of whoever made the file.
        with np.load(path, allow_pickle=False) as archive:
            needed = [name for name in archive.files if selection.takes_within(name)]
            passed = tuple(name for name in archive.files if name not in needed)
            columns = read_frame({name: archive[name] for name in needed}, selection)
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        raise RigtwinError(f"{path} is damaged, or holds Python objects: {error}") from None
    return Columns(
        columns.values,
        columns.units,
        "NumPy archive",
        wrong=columns.wrong,
        listed=(*columns.listed, *passed),
        refused=columns.refused,
    )


FORMAT = Format("NumPy archive", (".npz",), read_archive)
