"""From files of another program to a recording, saying what was found on the way."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_path, forbid_overwriting, recordable
from rigtwin.importing.columns import Columns, join
from rigtwin.importing.derived import evaluate, unwrap
from rigtwin.importing.mapping import Column, Map, Source, load
from rigtwin.importing.oddities import find_oddities, looks_wrapped
from rigtwin.importing.table import read
from rigtwin.importing.text import split_unit
from rigtwin.importing.timing import (
    Signals,
    drop_repeats,
    find_period,
    require_even_ticks,
    resample,
)
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

BLOCK = 10_000
"""Ticks written at a time."""
LARGEST = 1e15
"""What no channel reaches, in SI units."""
Channels = Mapping[tuple[str, str], Array]
"""(Topic, field) → shape (ticks,)."""


def convert(data: Sequence[Path], map_path: Path, out: Path) -> list[str]:
    """Converts another program's data to a recording.

    Parameters
    ----------
    data
        Files; several are put side by side, row by row.
    map_path
        Which column is which channel, TOML.
    out
        Of the recording.

    Returns
    -------
    list of str
        What was found on the way, a line each.

    Raises
    ------
    RigtwinError
        Before anything is written.
    """
    recordable(forbid_overwriting(out, *data, map_path))
    wanted = load(map_path)
    if len({path.stem for path in data}) < len(data):
        raise RigtwinError("two of the files have the same name; rename one, they are told by it")
    columns = join({path.stem: read(path) for path in data})
    said = ", ".join(map(str, data))
    report = [f"{said}: {columns.form}; {columns.rows} rows, columns {', '.join(columns.values)}"]
    report += columns.notes
    try:
        inputs = _inputs(wanted, columns)
        signals: Signals = {
            name: _signal(columns, name, each, report) for name, each in inputs.items()
        }
        report += _notes(columns, inputs)
        time = _time(columns, wanted, signals)
        time, signals = drop_repeats(time, signals, report)
        taken = (time - time[0] >= wanted.start) & (time - time[0] <= wanted.until)
        if taken.sum() < 2:
            raise RigtwinError(
                f"nothing lies between start = {wanted.start:g} s and until = {wanted.until:g} s"
            )
        time, signals = time[taken], {name: values[taken] for name, values in signals.items()}
        period = wanted.period or find_period(time)
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
        raise RigtwinError(f"{said}: {error}") from None
    for channel, values in channels.items():
        report += [f"{'.'.join(channel)} {each}" for each in find_oddities(values, time - time[0])]
    _write(out, wanted, period, channels)
    report.append(f"{len(time)} ticks of {period:g} s for machine {wanted.machine} in {out}")
    return report


def _inputs(wanted: Map, columns: Columns) -> dict[str, Column]:
    """The columns that are read: of channels by the channel's name, of formulas by their own."""
    found = {}
    for channel, source in wanted.channels.items():
        if source.column is not None:
            found[".".join(channel)] = source.column
        for name in source.formula.inputs if source.formula is not None else ():
            found[name] = wanted.columns.get(name, Column(name, None, None))
    return {key: replace(each, name=_named(columns, each.name)) for key, each in found.items()}


def _named(columns: Columns, name: str) -> str:
    """A column's name, also where the map has it as the file's first line does, its unit behind
    it."""
    if name in columns.values:
        return name
    bare, unit = split_unit(name, "")
    return bare if columns.units.get(bare) == unit != "" else name


def _column(columns: Columns, name: str) -> Array:
    if name not in columns.values:
        close = difflib.get_close_matches(name, columns.values, 1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise RigtwinError(f"no column {name!r}; {hint}there are {', '.join(columns.values)}")
    return columns.values[name]


def _signal(columns: Columns, name: str, asked: Column, report: list[str]) -> Array:
    """A column in SI, shape (rows,)."""
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


def _notes(columns: Columns, inputs: Mapping[str, Column]) -> list[str]:
    """What people should know of a column's unit, and of its counts."""
    found = []
    for name, asked in inputs.items():
        said = columns.units.get(asked.name)
        if asked.unit is None and said is None:
            found.append(f"{name}: no unit is said of column {asked.name!r}; taken as SI")
        if (
            asked.unit is not None
            and said is not None
            and is_unit(said)
            and unit_of(said) != unit_of(asked.unit)
        ):
            found.append(
                f"{name}: the file says {said} of column {asked.name!r}, the map {asked.unit}; "
                f"taken as {asked.unit}"
            )
        wrap = looks_wrapped(columns.values[asked.name]) if asked.wrap is None else None
        if wrap is not None:
            found.append(
                f"{name}: column {asked.name!r} steps from one end of {wrap:.0f} counts to the "
                f"other; if it begins again there, say wrap = {wrap:.0f} in the map"
            )
    return found


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
    """Raises RigtwinError where a cell held no number."""
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
    """A channel, shape (ticks,)."""
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


def _write(out: Path, wanted: Map, period: float, channels: Channels) -> None:
    fields: dict[str, list[str]] = {}
    for topic, name in channels:
        fields.setdefault(topic, []).append(name)
    ticks = len(next(iter(channels.values())))
    names = {topic: tuple(each) for topic, each in fields.items()}
    with (
        atomic_path(out) as beside,
        Writer(
            beside, wanted.experiment, period, wanted.controller, wanted.machine, names
        ) as writer,
    ):
        for start in range(0, ticks, BLOCK):
            part = slice(start, min(start + BLOCK, ticks))
            blocks = {
                topic.strip("/"): np.column_stack([channels[topic, name][part] for name in each])
                for topic, each in names.items()
            }
            writer.append(**blocks)
