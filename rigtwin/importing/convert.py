"""From files of another program to a recording, with a report of the conversion."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from rigtwin.description import catalogue
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_path, forbid_overwriting, recordable
from rigtwin.importing.columns import Columns, join
from rigtwin.importing.derived import evaluate, unwrap
from rigtwin.importing.episodes import Episode, split_episodes
from rigtwin.importing.frames import read_frame
from rigtwin.importing.mapping import Column, Map, Source, load
from rigtwin.importing.naming import split_unit
from rigtwin.importing.oddities import find_oddities, looks_wrapped
from rigtwin.importing.selection import EVERYTHING, Selection
from rigtwin.importing.table import read
from rigtwin.importing.timing import (
    Signals,
    drop_repeats,
    find_period,
    require_even_ticks,
    require_plausible,
    resample,
)
from rigtwin.importing.units import QUANTITIES, is_unit, unit_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

BLOCK = 10_000
"""Ticks written at a time."""
Data = Any
"""Paths of files, a list; or data in memory."""
LARGEST = 1e15
"""Bound on the magnitude of a channel, in SI units."""
Channels = Mapping[tuple[str, str], Array]
"""(Topic, field) → shape (ticks,)."""
ENDING = ".mcap"
"""Ending of a recording's name."""


@dataclass(frozen=True)
class Imported:
    """Channels of a recording, read from another program's data.

    Parameters
    ----------
    period
        Period of the ticks, s.
    time
        Time of the ticks, s, shape (ticks,).
    channels
        (Topic, field) → values in SI, shape (ticks,).
    report
        Report of the conversion, one line per remark.
    """

    period: float
    time: Array
    channels: Channels
    report: tuple[str, ...]


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
    data: Data,
    mapping: Path | Mapping[str, Any],
    out: Path,
    machine: Machine | None = None,
) -> list[str]:
    """Convert another program's data to a recording.

    Parameters
    ----------
    data
        Files; several are put side by side, row by row. Or data in memory, see `read_frame`.
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
        Before anything is written. Also if the data hold several episodes.
    """
    recordable(forbid_overwriting(out, *_files(data, mapping)))
    wanted = load(mapping)
    described = _machine(wanted, machine)
    imported = read_channels(data, wanted, described)
    return [*imported.report, _write(out, wanted, described, imported)]


def convert_episodes(
    data: Data,
    mapping: Path | Mapping[str, Any],
    folder: Path,
    machine: Machine | None = None,
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
        In the order of the episodes. An episode that cannot be converted is left out, which every
        report states.

    Raises
    ------
    RigtwinError
        If no episode can be converted, or the folder cannot be written.
    """
    wanted = load(mapping)
    label, columns = _label(data), read_columns(data, wanted.selection)
    episodes = _split(label, columns, wanted)
    _make_folder(folder)
    if not episodes:
        out = folder / f"{data[0].stem if _are_paths(data) else 'recording'}{ENDING}"
        return (Written(out, tuple(convert(data, mapping, out, machine))),)
    described = _machine(wanted, machine)
    header, done, errors = _header(label, columns), [], []
    for episode in episodes:
        out = folder / f"{episode.name}{ENDING}"
        try:
            imported = _channels(label, episode.columns, wanted, described)
            line = _write(recordable(out), wanted, described, imported)
        except RigtwinError as error:
            errors.append(error)
            header.append(f"episode {episode.number} is left out: {error}")
        else:
            lines = [f"episode {episode.number}: {each}" for each in (*imported.report, line)]
            done.append(Written(out, tuple(lines)))
    if not done:
        raise errors[0]
    return tuple(replace(each, report=(*header, *each.report)) for each in done)


def read_columns(data: Data, selection: Selection = EVERYTHING) -> Columns:
    """Return the columns of another program's data.

    Parameters
    ----------
    data
        Files, which are put side by side, row by row; or data in memory, see `read_frame`.
    selection
        Columns and episodes that are needed. Defaults to all.

    Returns
    -------
    Columns
        The needed columns, and the names of all.
    """
    if not _are_paths(data):
        return read_frame(data, selection)
    if len({path.stem for path in data}) < len(data):
        raise RigtwinError("two of the files have the same name; rename one of them")
    return join({path.stem: read(path, selection.of_file(path.stem)) for path in data})


def read_channels(data: Data, wanted: Map, machine: Machine | None = None) -> Imported:
    """Return the channels that a map makes of another program's data.

    Parameters
    ----------
    data
        Files, which are put side by side, row by row; or data in memory, see `read_frame`.
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
        Naming the column, unit or line that is at fault. Also if the data hold several episodes.
    """
    label, columns = _label(data), read_columns(data, wanted.selection)
    episodes = _split(label, columns, wanted)
    if len(episodes) > 1:
        raise RigtwinError(
            f"{label} holds {len(episodes)} episodes; name a folder as the output, such as "
            "-o episodes/, which gets a recording of each, or choose one in the map: "
            f"[episodes] take = [{episodes[0].number}]"
        )
    header = _header(label, columns)
    imported = _channels(label, episodes[0].columns if episodes else columns, wanted, machine)
    return replace(imported, report=(*header, *imported.report))


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
    """Return what data are called in messages."""
    return ", ".join(map(str, data)) if _are_paths(data) else "the data"


def _split(label: str, columns: Columns, wanted: Map) -> list[Episode]:
    """Return the episodes of data that hold several tests, else none."""
    name = wanted.episode or columns.episode
    if not name:
        if wanted.episodes:
            raise RigtwinError(
                f"{label}: [episodes] take needs [episodes] column, which numbers the episodes"
            )
        return []
    try:
        _column(columns, name)
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


def _channels(label: str, columns: Columns, wanted: Map, machine: Machine | None) -> Imported:
    """Return the channels of one test."""
    report: list[str] = []
    try:
        inputs = {
            key: replace(column, name=_named(columns, column.name))
            for key, column in wanted.inputs.items()
        }
        signals: Signals = {
            name: _signal(columns, name, each, report) for name, each in inputs.items()
        }
        _require_units(columns, wanted, inputs, _units(wanted, machine))
        report += _notes(columns, inputs)
        report += _time_notes(columns, wanted)
        time = _time(columns, wanted, signals)
        time, signals = drop_repeats(time, signals, report)
        taken = (time - time[0] >= wanted.start) & (time - time[0] <= wanted.until)
        if taken.sum() < 2:
            raise RigtwinError(
                f"nothing lies between start = {wanted.start:g} s and until = {wanted.until:g} s"
            )
        time, signals = time[taken], {name: values[taken] for name, values in signals.items()}
        period = wanted.period or find_period(time)
        if wanted.period is None:
            require_plausible(period, not _times_without_unit(columns, wanted))
        _require_numbers(columns, inputs, time, signals)
        if wanted.resample is not None:
            time, signals = resample(time, signals, period, wanted.resample, report)
            period = wanted.resample
        else:
            require_even_ticks(time, period, report)
        channels = {
            channel: _values(".".join(channel), source, signals, time, period)
            for channel, source in wanted.channels.items()
        }
    except RigtwinError as error:
        raise RigtwinError(f"{label}: {error}") from None
    for channel, values in channels.items():
        report += [f"{'.'.join(channel)} {each}" for each in find_oddities(values, time - time[0])]
    return Imported(period, time, channels, tuple(report))


def _named(columns: Columns, name: str) -> str:
    """Return the name of a column, which a map may write with its unit as the file does."""
    if name in columns.values or name in columns.refused:
        return name
    bare, unit = split_unit(name, "")
    return bare if columns.units.get(bare) == unit != "" else name


def _column(columns: Columns, name: str) -> Array:
    if name in columns.refused:
        raise RigtwinError(f"column {name!r} cannot be read: {columns.refused[name]}")
    if name not in columns.values:
        close = difflib.get_close_matches(name, columns.names, 1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise RigtwinError(f"no column {name!r}; {hint}there are {', '.join(columns.names)}")
    return columns.values[name]


def _signal(columns: Columns, name: str, asked: Column, report: list[str]) -> Array:
    """Return a column in SI, shape (rows,)."""
    values = _column(columns, asked.name)
    said = asked.unit if asked.unit is not None else columns.units.get(asked.name, "1")
    try:
        _, factor = unit_of(said)
    except RigtwinError as error:
        raise RigtwinError(f"column {asked.name!r}: {error}; say the unit in the map") from None
    if asked.wrap is None:
        return factor * values
    values, bridged = unwrap(values, asked.wrap)
    if bridged:
        report.append(f"{name}: {bridged} rows lie between both ends of the counter; bridged")
    return factor * values


def _units(wanted: Map, machine: Machine | None) -> Mapping[str, str]:
    """Return the units of the machine's channels; none for a machine that is unknown here."""
    if machine is None and wanted.machine in catalogue.shipped():
        machine = catalogue.find(wanted.machine)
    return {} if machine is None else machine.units


def _require_units(
    columns: Columns, wanted: Map, inputs: Mapping[str, Column], units: Mapping[str, str]
) -> None:
    """Raise RigtwinError for a column in a unit of another quantity than its channel's.

    A scale converts quantities, such as volts to newtons, so channels with one are not checked.
    """
    for channel, source in wanted.channels.items():
        name = ".".join(channel)
        if source.column is None or source.scale != 1.0 or name not in units:
            continue
        said = inputs[name].unit or columns.units.get(inputs[name].name)
        quantity = unit_of(said)[0] if said else "1"
        if units[name] in QUANTITIES and quantity not in ("1", units[name]):
            raise RigtwinError(
                f"{name} is in {said!r}; expected a unit of {units[name]}, as the machine has it, "
                "or a scale that converts it"
            )


def _notes(columns: Columns, inputs: Mapping[str, Column]) -> list[str]:
    """Return remarks on the units of columns, and on counters that seem to wrap."""
    notes = []
    for name, asked in inputs.items():
        said = columns.units.get(asked.name)
        if asked.unit is None and said is None:
            notes.append(f"{name}: no unit is said of column {asked.name!r}; taken as SI")
        if (
            asked.unit is not None
            and said is not None
            and is_unit(said)
            and unit_of(said) != unit_of(asked.unit)
        ):
            notes.append(
                f"{name}: the file says {said} of column {asked.name!r}, the map {asked.unit}; "
                f"taken as {asked.unit}"
            )
        wrap = looks_wrapped(columns.values[asked.name]) if asked.wrap is None else None
        if wrap is not None:
            notes.append(
                f"{name}: column {asked.name!r} steps from one end of {wrap:.0f} counts to the "
                f"other; if it begins again there, say wrap = {wrap:.0f} in the map"
            )
    return notes


def _times_without_unit(columns: Columns, wanted: Map) -> list[str]:
    """Return the columns of time whose unit neither the map nor the file states."""
    if wanted.time_unit is not None:
        return []
    names = [_named(columns, name) for name in wanted.time]
    return [name for name in names if name not in columns.units]


def _time_notes(columns: Columns, wanted: Map) -> list[str]:
    return [
        f"time: no unit is said of column {name!r}; taken as s"
        for name in _times_without_unit(columns, wanted)
    ]


def _time(columns: Columns, wanted: Map, signals: Signals) -> Array:
    lengths = {len(values) for values in signals.values()}
    if len(lengths) > 1:
        raise RigtwinError(
            f"the columns have different lengths: {', '.join(map(str, sorted(lengths)))}"
        )
    if lengths <= {0, 1}:
        raise RigtwinError("no column of more than one value is mapped")
    (rows,) = lengths
    if wanted.period is not None:
        return np.arange(rows) * wanted.period
    total = np.zeros(rows)
    for name in (_named(columns, each) for each in wanted.time):
        values = _column(columns, name)
        if len(values) != rows:
            raise RigtwinError(f"the time column has {len(values)} rows, the others {rows}")
        said = wanted.time_unit or columns.units.get(name, "s")
        base, factor = unit_of(said)
        if base != "s":
            raise RigtwinError(
                f"time column {name!r} is in {said!r}; expected a unit of time, "
                "say it in [time] unit"
            )
        if not np.isfinite(values).all():
            where = columns.wrong.get(name) or f"row {int(np.argmax(~np.isfinite(values))) + 1}"
            raise RigtwinError(f"time column {name!r} is not a number in {where}")
        total = total + factor * values
    return total


def _require_numbers(
    columns: Columns, inputs: Mapping[str, Column], time: Array, signals: Signals
) -> None:
    """Raise RigtwinError where a cell holds no number."""
    for name, values in signals.items():
        wrong = ~np.isfinite(values)
        if wrong.any():
            when = time[int(np.argmax(wrong))] - time[0]
            cell = columns.wrong.get(inputs[name].name)
            raise RigtwinError(
                f"{name} is not a number in {int(wrong.sum())} rows, the first at {when:g} s"
                f"{f' ({cell})' if cell else ''}; "
                "take a stretch without them by [time] start and until"
            )


def _values(name: str, source: Source, signals: Signals, time: Array, period: float) -> Array:
    """Return the values of a channel, shape (ticks,)."""
    if source.constant is not None:
        return np.full(len(time), source.constant)
    with np.errstate(over="ignore"):
        if source.formula is None:
            values = source.sign * source.scale * signals[name] + source.offset
        else:
            values = evaluate(source.formula, signals, period)
    if (beyond := ~(np.abs(values) < LARGEST)).any():
        when = time[int(np.argmax(beyond))] - time[0]
        text = f" = {source.formula.text}" if source.formula is not None else ""
        raise RigtwinError(
            f"{name}{text} is {values[beyond][0]:g} at {when:g} s; expected numbers below "
            f"{LARGEST:g}"
        )
    return values


def _write(out: Path, wanted: Map, machine: Machine | None, imported: Imported) -> str:
    """Write a recording; return the last line of the report."""
    channels, period, ticks = imported.channels, imported.period, len(imported.time)
    fields: dict[str, list[str]] = {}
    for topic, field in channels:
        fields.setdefault(topic, []).append(field)
    name = wanted.machine if machine is None else machine.name
    with (
        atomic_path(out) as beside,
        Writer(
            beside,
            wanted.experiment,
            period,
            wanted.controller,
            name,
            {topic: tuple(each) for topic, each in fields.items()},
            None if machine is None else catalogue.own_description(machine),
        ) as writer,
    ):
        for start in range(0, ticks, BLOCK):
            part = slice(start, min(start + BLOCK, ticks))
            blocks = {
                topic.strip("/"): np.column_stack([channels[topic, each][part] for each in names])
                for topic, names in fields.items()
            }
            writer.append(**blocks)
    return f"{ticks} ticks of {period:g} s for machine {name} in {out}"
