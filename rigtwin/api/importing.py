"""Recordings made from other programs' data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rigtwin.api.recordings import Recording, load, resolve_optional
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.importing.convert import Data, convert, convert_episodes


def import_data(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> Recording:
    """Convert another program's data to a recording.

    Parameters
    ----------
    data
        File or folder of a kind that docs/importing.md lists; several files, which are put side by
        side, row by row; or data in memory: a pandas DataFrame, an Arrow table, or a dictionary of
        name → array, shape (rows,) or (rows, items).
    mapping
        Map from columns to channels (docs/importing.md): a TOML file, or its tables as a
        dictionary.
    out
        File of the recording, MCAP.
    machine
        Machine the data belong to, or its name or description. Defaults to the one named in the
        map.

    Returns
    -------
    Recording
        The recording. Its `report` has lines about the data: gaps, repeated times, columns used.

    Raises
    ------
    RigtwinError
        If the data cannot be imported; the message names the column, unit or line. Also for data
        of several episodes, which `import_episodes` reads.

    Examples
    --------
    >>> rigtwin.import_data("bench.csv", "map.toml", "bench.mcap")  # doctest: +SKIP
    """
    described = resolve_optional(machine)
    report = convert(_as_paths(data), _as_map(mapping), Path(out), described)
    return replace(load(out, described), report=tuple(report))


def import_episodes(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> tuple[Recording, ...]:
    """Convert each episode of another program's data to a recording.

    Parameters
    ----------
    data, mapping, machine
        As for `import_data`.
    folder
        Folder of the recordings. It is created if it does not exist.

    Returns
    -------
    tuple of Recording
        Recordings in the order of the episodes. An episode that cannot be imported is omitted, and
        every report states so.

    Raises
    ------
    RigtwinError
        If no episode can be imported.
    """
    described = resolve_optional(machine)
    episodes = convert_episodes(_as_paths(data), _as_map(mapping), Path(folder), described)
    return tuple(
        replace(load(episode.path, described), report=episode.report) for episode in episodes
    )


def _as_paths(data: Any) -> Any:
    """Return paths as a list, and data in memory as they are."""
    if isinstance(data, str | Path):
        return [Path(data)]
    if (
        isinstance(data, list | tuple)
        and data
        and all(isinstance(name, str | Path) for name in data)
    ):
        return [Path(name) for name in data]
    if isinstance(data, bool | int | float) or data is None:
        raise RigtwinError(f"data {data!r}: expected the path of a file, or a table in memory")
    return data


def _as_map(mapping: str | Path | Mapping[str, Any]) -> Path | Mapping[str, Any]:
    return mapping if isinstance(mapping, Mapping) else Path(mapping)
