"""Convert files of another program to a recording, with a report of the conversion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

from rigtwin.description import catalogue
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting, recordable
from rigtwin.importing.channels import Imported, find_column, make_channels
from rigtwin.importing.columns import Columns, join
from rigtwin.importing.episodes import Episode, split_episodes
from rigtwin.importing.frames import read_frame
from rigtwin.importing.map_file import load
from rigtwin.importing.mapping import Map
from rigtwin.importing.selection import EVERYTHING, Selection
from rigtwin.importing.table import read
from rigtwin.importing.written_test import write_test

Data = Any
"""List of paths, or data in memory."""
ENDING = ".mcap"
"""Ending of a recording's name."""


@dataclass(frozen=True)
class Written:
    """A recording made of one episode of another program's data.

    Parameters
    ----------
    path
        File of the recording.
    report
        Report of the conversion, one line per remark.
    """

    path: Path
    report: tuple[str, ...]


def convert(
    data: Data, mapping: Path | Mapping[str, Any], out: Path, machine: Machine | None = None
) -> list[str]:
    """Convert another program's data to a recording.

    Parameters
    ----------
    data
        Files, whose columns are joined row by row; or data in memory, see `read_frame`.
    mapping
        Map from columns to channels: a TOML file, or its tables.
    out
        File of the recording.
    machine
        Machine the data belong to. Defaults to the one named in the map.

    Returns
    -------
    list of str
        Report of the conversion, one line per remark.

    Raises
    ------
    RigtwinError
        If map or data are invalid, or the data hold several episodes. Nothing is written then.
    """
    # The output is checked first, since reading may take minutes.
    recordable(forbid_overwriting(out, *_files(data, mapping)))
    wanted = load(mapping)
    described = _machine(wanted, machine)
    imported = read_channels(data, wanted, described)
    return [*imported.report, write_test(out, wanted, described, imported)]


def convert_episodes(
    data: Data, mapping: Path | Mapping[str, Any], folder: Path, machine: Machine | None = None
) -> tuple[Written, ...]:
    """Convert each episode of another program's data to a recording.

    Parameters
    ----------
    data, mapping, machine
        As for `convert`.
    folder
        Folder of the recordings, made if it is absent. Each is named by its episode's number.

    Returns
    -------
    tuple of Written
        Recordings in the order of the episodes. An episode that cannot be converted is left out;
        every report says so.

    Raises
    ------
    RigtwinError
        If no episode can be converted, or the folder cannot be written.
    """
    wanted = load(mapping)
    label, columns = _label(data), read_columns(data, wanted.selection)
    episodes = _split(label, columns, wanted)
    _make_folder(folder)
    # Data without episodes are one test, which gets the name of its file.
    if not episodes:
        out = folder / f"{data[0].stem if _are_paths(data) else 'recording'}{ENDING}"
        return (Written(out, tuple(convert(data, mapping, out, machine))),)
    described = _machine(wanted, machine)
    # The header says what the whole file holds, so it is made once.
    header, done, errors = _header(label, columns), [], []
    for episode in episodes:
        out = folder / f"{episode.name}{ENDING}"
        try:
            # One damaged episode must not prevent the conversion of the others.
            imported = make_channels(label, episode.columns, wanted, _units(wanted, described))
            line = write_test(recordable(out), wanted, described, imported)
        except RigtwinError as error:
            errors.append(error)
            header.append(f"episode {episode.number} is left out: {error}")
        else:
            lines = [f"episode {episode.number}: {each}" for each in (*imported.report, line)]
            done.append(Written(out, tuple(lines)))
    if not done:
        # Nothing could be converted: the first reason stands for all.
        raise errors[0]
    return tuple(replace(each, report=(*header, *each.report)) for each in done)


def read_columns(data: Data, selection: Selection = EVERYTHING) -> Columns:
    """Return the columns of another program's data.

    Parameters
    ----------
    data
        Files, whose columns are joined row by row; or data in memory, see `read_frame`.
    selection
        Columns and episodes that are needed. Defaults to all.

    Returns
    -------
    Columns
        The needed columns, and the names of all.
    """
    if not _are_paths(data):
        return read_frame(data, selection)
    # A column is called `stem.name`, so equal stems would make columns ambiguous.
    if len({path.stem for path in data}) < len(data):
        raise RigtwinError("two of the files have the same name; rename one of them")
    return join({path.stem: read(path, selection.of_file(path.stem)) for path in data})


def read_channels(data: Data, wanted: Map, machine: Machine | None = None) -> Imported:
    """Return the channels that a map makes of another program's data.

    Parameters
    ----------
    data
        Files, whose columns are joined row by row; or data in memory, see `read_frame`.
    wanted
        Map from columns to channels.
    machine
        Machine whose units the channels must have. Defaults to the shipped one that the map names.

    Returns
    -------
    Imported
        Channels of one test.

    Raises
    ------
    RigtwinError
        If a column, unit or line is wrong, which the message names, or the data hold several
        episodes.
    """
    tests = read_tests(data, wanted, machine)
    if len(tests) > 1:
        raise RigtwinError(
            f"{_label(data)} holds {len(tests)} episodes; name a folder as the output, such as "
            "-o episodes/, for a recording of each, or choose one in the map: "
            f"[episodes] take = [{next(iter(tests))}]"
        )
    return next(iter(tests.values()))


def read_tests(
    data: Data, wanted: Map, machine: Machine | None = None
) -> dict[int | None, Imported]:
    """Return the channels of every test in another program's data.

    Parameters
    ----------
    data, wanted, machine
        As for `read_channels`.

    Returns
    -------
    dict
        Number of the episode, or None for data of one test → its channels.

    Raises
    ------
    RigtwinError
        If a column, unit or line is wrong, which the message names.
    """
    label, columns = _label(data), read_columns(data, wanted.selection)
    header, units = _header(label, columns), _units(wanted, machine)
    episodes = _split(label, columns, wanted)
    tables = {episode.number: episode.columns for episode in episodes} or {None: columns}
    tests = {}
    for number, table in tables.items():
        imported = make_channels(label, table, wanted, units)
        tests[number] = replace(imported, report=(*header, *imported.report))
    return tests


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None


def _files(data: Data, mapping: Path | Mapping[str, Any]) -> list[Path]:
    """Return the files that an import reads."""
    files = list(data) if _are_paths(data) else []
    return [*files, mapping] if isinstance(mapping, Path) else files


def _are_paths(data: Data) -> TypeGuard[Sequence[Path]]:
    return isinstance(data, list | tuple) and all(isinstance(path, Path) for path in data)


def _label(data: Data) -> str:
    """Return the name of the data in messages."""
    return ", ".join(map(str, data)) if _are_paths(data) else "the data"


def _split(label: str, columns: Columns, wanted: Map) -> list[Episode]:
    """Return the episodes of data that hold several tests, else none."""
    name = wanted.episode or columns.episode
    if not name:
        if wanted.episodes:
            raise RigtwinError(
                f"{label}: [episodes] with `take` needs `column` too, which numbers the episodes"
            )
        return []
    try:
        find_column(columns, name)
        return list(split_episodes(columns, name, wanted.episodes))
    except RigtwinError as error:
        raise RigtwinError(f"{label}: {error}") from None


def _machine(wanted: Map, machine: Machine | None) -> Machine | None:
    """Return the machine that was given, or the one whose description the map names, if any."""
    if machine is not None or not wanted.machine.endswith(".toml"):
        return machine
    return catalogue.find(str(wanted.folder / wanted.machine))


def _header(label: str, columns: Columns) -> list[str]:
    """Return the first lines of the report: what the data hold."""
    names = ", ".join(columns.names)
    return [f"{label}: {columns.form}; {columns.rows} rows, columns {names}", *columns.notes]


def _units(wanted: Map, machine: Machine | None) -> Mapping[str, str]:
    """Return the units of the machine's channels; none for a machine that is unknown here."""
    if machine is None and wanted.machine in catalogue.shipped():
        machine = catalogue.find(wanted.machine)
    return {} if machine is None else machine.units
