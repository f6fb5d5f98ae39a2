"""Channels made of another program's columns, by a map."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.derived import evaluate, unwrap
from rigtwin.importing.mapping import Column, Map, Source
from rigtwin.importing.naming import split_unit
from rigtwin.importing.oddities import find_oddities, looks_wrapped
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

LARGEST = 1e15
"""Bound on the magnitude of a channel, in SI units."""
Channels = Mapping[tuple[str, str], Array]
"""(Topic, field) → shape (ticks,)."""


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


def make_channels(label: str, columns: Columns, wanted: Map, units: Mapping[str, str]) -> Imported:
    """Return the channels of one test.

    Parameters
    ----------
    label
        Name of the data, for messages.
    columns
        Columns of the data.
    wanted
        Map from columns to channels.
    units
        Channel → its unit in the machine, where it is known.
    """
    report: list[str] = []
    try:
        inputs = {
            key: replace(column, name=_named(columns, column.name))
            for key, column in wanted.inputs.items()
        }
        signals: Signals = {
            name: _signal(columns, name, each, report) for name, each in inputs.items()
        }
        _require_units(columns, wanted, inputs, units)
        report += _notes(columns, inputs)
        report += _time_notes(columns, wanted)
        time = _time(columns, wanted, signals)
        # Order matters: repeats and the stretch are settled before the period is, since rows
        # outside the stretch may be irregular; numbers are required only within it.
        time, signals = drop_repeats(time, signals, report)
        # Start and end count from the first row, whatever clock the stamps are of.
        taken = (time - time[0] >= wanted.start) & (time - time[0] <= wanted.until)
        if taken.sum() < 2:
            raise RigtwinError(
                f"nothing lies between start = {wanted.start:g} s and until = {wanted.until:g} s"
            )
        time, signals = time[taken], {name: values[taken] for name, values in signals.items()}
        period = wanted.period or find_period(time)
        # A stated period needs no check of the time column's unit.
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
    # A name with another unit than the file's is another name, so that it is refused.
    return bare if columns.units.get(bare) == unit != "" else name


def find_column(columns: Columns, name: str) -> Array:
    if name in columns.refused:
        raise RigtwinError(f"column {name!r} cannot be read: {columns.refused[name]}")
    if name not in columns.values:
        close = difflib.get_close_matches(name, columns.names, 1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise RigtwinError(f"no column {name!r}; {hint}there are {', '.join(columns.names)}")
    return columns.values[name]


def _signal(columns: Columns, name: str, asked: Column, report: list[str]) -> Array:
    """Return a column in SI, shape (rows,)."""
    values = find_column(columns, asked.name)
    # The map's unit wins: its author has seen the file, and may know that the file's is wrong.
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
        # A counter that wraps is only suspected here: a true signal may jump as far.
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
        values = find_column(columns, name)
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
        # A date and a time of day in two columns add up to one time.
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
    # An overflow gives infinity, which is refused below with the time at which it occurs.
    with np.errstate(over="ignore"):
        if source.formula is None:
            values = source.sign * source.scale * signals[name] + source.offset
        else:
            values = evaluate(source.formula, signals, period)
    # Negated, so that NaN is refused as well.
    if (beyond := ~(np.abs(values) < LARGEST)).any():
        when = time[int(np.argmax(beyond))] - time[0]
        text = f" = {source.formula.text}" if source.formula is not None else ""
        raise RigtwinError(
            f"{name}{text} is {values[beyond][0]:g} at {when:g} s; expected numbers below "
            f"{LARGEST:g}"
        )
    return values
