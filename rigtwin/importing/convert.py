"""From a file of another program to a recording, saying what was found on the way."""

from __future__ import annotations

import difflib
from pathlib import Path

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.mapping import Map, Source, load
from rigtwin.importing.table import Columns, read
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

FLAT = 8
"""Equal samples in a row at a signal's very end of range, with a step into them: it is cut off
there."""
ABRUPT, BITS = 0.1, 2.0
"""Share of a signal's typical step, and its smallest steps, with which it runs into such a stretch
at least."""
OUTLIER = 100.0
"""Times the range of nearly all of a signal at which a sample is damage."""
JITTER = 0.5
"""Share of the period by which a time stamp may be off."""
BLOCK = 10_000
"""Ticks written at a time."""


def convert(data: Path, map_path: Path, out: Path) -> list[str]:
    """Converts another program's file to a recording.

    Parameters
    ----------
    data : Path
        The file.
    map_path : Path
        Which column is which channel, TOML.
    out : Path
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
    wanted, columns = load(map_path), read(data)
    report = [
        f"{data}: {columns.form}; {len(next(iter(columns.values.values())))} rows, "
        f"columns {', '.join(columns.values)}"
    ]
    signals = {
        channel: _signal(data, columns, source) for channel, source in wanted.channels.items()
    }
    report += [
        line
        for channel, source in wanted.channels.items()
        for line in _unit_notes(columns, channel, source)
    ]
    lengths = {len(values) for values in signals.values() if len(values) > 1}
    if len(lengths) > 1:
        raise RigtwinError(
            f"{data}: the columns have different lengths: {', '.join(map(str, sorted(lengths)))}"
        )
    if not lengths:
        raise RigtwinError(f"{data}: no column of more than one value is mapped")
    (rows,) = lengths
    signals = {
        channel: np.full(rows, values[0]) if len(values) == 1 else values
        for channel, values in signals.items()
    }
    time = _time(data, columns, wanted, rows)
    time, signals = _drop_repeats(data, time, signals, report)
    taken = (time - time[0] >= wanted.start) & (time - time[0] <= wanted.until)
    if taken.sum() < 2:
        raise RigtwinError(
            f"{data}: "
            f"nothing lies between start = {wanted.start:g} s and until = {wanted.until:g} s"
        )
    time, signals = time[taken], {channel: values[taken] for channel, values in signals.items()}
    period = wanted.period or _period(time)
    _require_numbers(data, time, signals)
    if wanted.resample is not None:
        bridged = np.diff(time)
        bridged = bridged[bridged > (1.0 + JITTER) * period]
        if len(bridged):
            report.append(
                f"{len(bridged)} gaps are bridged straight, the longest of {bridged.max():.4g} s, "
                f"{bridged.sum():.4g} s in all"
            )
        time, signals = _resample(time, signals, period, wanted.resample)
        report.append(f"resampled from {period:g} s to {wanted.resample:g} s: {len(time)} ticks")
        period = wanted.resample
    else:
        _require_even_ticks(data, time, period, report)
    for channel, values in signals.items():
        report += [
            f"{channel[0]}.{channel[1]} {each}" for each in _find_oddities(values, time - time[0])
        ]
    ticks = _write(out, wanted, period, signals)
    report.append(f"{ticks} ticks of {period:g} s for machine {wanted.machine} in {out}")
    return report


def _column(data: Path, columns: Columns, name: str) -> Array:
    if name not in columns.values:
        close = difflib.get_close_matches(name, columns.values, 1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise RigtwinError(
            f"{data}: it has no column {name!r}; {hint}there are {', '.join(columns.values)}"
        )
    return columns.values[name]


def _signal(data: Path, columns: Columns, source: Source) -> Array:
    """The channel in SI, shape (rows,), or (1,) for a constant."""
    if source.constant is not None:
        return np.array([source.constant])
    values = _column(data, columns, source.column)
    said = source.unit if source.unit is not None else columns.units.get(source.column, "1")
    try:
        _, factor = unit_of(said)
    except RigtwinError as error:
        raise RigtwinError(
            f"{data}: column {source.column!r}: {error}; say the unit in the map"
        ) from None
    return source.sign * source.scale * factor * values + source.offset


def _unit_notes(columns: Columns, channel: tuple[str, str], source: Source) -> list[str]:
    """What people should know of a channel's unit."""
    if source.constant is not None:
        return []
    said = columns.units.get(source.column)
    name = ".".join(channel)
    if source.unit is None and said is None:
        return [f"{name}: no unit is said of column {source.column!r}; taken as SI"]
    if (
        source.unit is not None
        and said is not None
        and is_unit(said)
        and unit_of(said) != unit_of(source.unit)
    ):
        return [
            f"{name}: the file says {said} of column {source.column!r}, the map {source.unit}; "
            f"taken as {source.unit}"
        ]
    return []


def _time(data: Path, columns: Columns, wanted: Map, rows: int) -> Array:
    if wanted.time is None:
        assert wanted.period is not None
        return np.arange(rows) * wanted.period
    values = _column(data, columns, wanted.time)
    if len(values) != rows:
        raise RigtwinError(f"{data}: the time column has {len(values)} rows, the others {rows}")
    said = wanted.time_unit or columns.units.get(wanted.time, "s")
    base, factor = unit_of(said)
    if base != "s":
        raise RigtwinError(
            f"{data}: time column {wanted.time!r} is in {said!r}; expected a unit of time, "
            "say it in [time] unit"
        )
    if not np.isfinite(values).all():
        raise RigtwinError(
            f"{data}: time is not a number in row {int(np.argmax(~np.isfinite(values))) + 1}"
        )
    return factor * values


def _drop_repeats(
    data: Path, time: Array, signals: dict[tuple[str, str], Array], report: list[str]
) -> tuple[Array, dict[tuple[str, str], Array]]:
    """Without rows that are there twice.

    Time that goes back, or two different values at one time, is refused.
    """
    steps = np.diff(time)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0)) + 2
        raise RigtwinError(
            f"{data}: time goes back in row {row}, from {time[row - 2]:g} s to {time[row - 1]:g} s"
        )
    again = np.concatenate([[False], steps == 0])
    if not again.any():
        return time, signals
    for channel, values in signals.items():
        unlike = again[1:] & (np.diff(values) != 0)
        if unlike.any():
            row = int(np.argmax(unlike)) + 2
            name = ".".join(channel)
            raise RigtwinError(
                f"{data}: row {row} has the same time as the one before, "
                f"but another value of {name}; expected each time once "
                "(is the time column's resolution too coarse? then give [time] period instead)"
            )
    report.append(f"{int(again.sum())} rows were there twice and are left out")
    return time[~again], {channel: values[~again] for channel, values in signals.items()}


def _require_numbers(data: Path, time: Array, signals: dict[tuple[str, str], Array]) -> None:
    """Raises RigtwinError where a cell held no number."""
    for channel, values in signals.items():
        wrong = ~np.isfinite(values)
        if wrong.any():
            when = time[int(np.argmax(wrong))] - time[0]
            raise RigtwinError(
                f"{data}: {'.'.join(channel)} is not a number in {int(wrong.sum())} rows, "
                f"the first at {when:g} s; "
                "take a stretch without them by [time] start and until"
            )


def _period(time: Array) -> float:
    """The period of time stamps, as round as they allow."""
    steps = np.diff(time)
    typical = float(np.median(steps))
    regular = np.abs(steps - typical) < JITTER * typical
    period = float(np.mean(steps[regular]))
    for digits in range(1, 8):
        rounded = float(f"{period:.{digits}g}")
        if (
            abs(rounded - period) * len(time) < JITTER * period
            and abs(rounded / period - 1.0) < 1e-3
        ):
            return rounded
    return period


def _require_even_ticks(data: Path, time: Array, period: float, report: list[str]) -> None:
    """Raises RigtwinError if the time stamps are not those of one period."""
    steps = np.diff(time)
    off = np.abs(steps - period) > JITTER * period
    if off.any():
        at = int(np.argmax(off))
        raise RigtwinError(
            f"{data}: {int(off.sum())} gaps in time, "
            f"the first of {steps[at]:.4g} s at {time[at] - time[0]:.4g} s where "
            f"{period:g} s is the rule; take a stretch without them by [time] start and until, "
            f"or say [time] resample = {period:g}"
        )
    drift = abs((time[-1] - time[0]) / (len(time) - 1) - period)
    if drift * len(time) > JITTER * period:
        report.append(
            f"time stamps drift: on average every {(time[-1] - time[0]) / (len(time) - 1):.6g} s, "
            f"mostly {period:g} s"
        )
    worst = float(np.max(np.abs(steps - period)))
    if worst > 0.01 * period:
        report.append(f"time stamps are off by up to {worst:.2g} s; taken as ticks of {period:g} s")


def _resample(
    time: Array, signals: dict[tuple[str, str], Array], period: float, wanted: float
) -> tuple[Array, dict[tuple[str, str], Array]]:
    """At another period, straight between samples.

    Smoothed first where that is longer, so that nothing is aliased.
    """
    from scipy.signal import butter, sosfiltfilt  # Late: it takes a second.

    ticks = np.arange(int((time[-1] - time[0]) / wanted + 1e-6) + 1) * wanted + time[0]
    found = {}
    for channel, values in signals.items():
        if wanted > 1.5 * period and len(values) > 60:
            values = sosfiltfilt(butter(4, 0.8 * period / wanted, output="sos"), values)
        found[channel] = np.interp(ticks, time, values)
    return ticks, found


def _find_oddities(values: Array, time: Array) -> list[str]:
    if np.ptp(values) == 0.0:
        return [f"is {values[0]:g} throughout"]
    found = []
    spread = float(np.subtract(*np.quantile(values, [0.999, 0.001])))
    far = np.abs(values - np.median(values))
    if spread > 0.0 and far.max() > OUTLIER * spread:
        found.append(
            f"is {values[np.argmax(far)]:.4g} at {time[np.argmax(far)]:.4g} s, "
            "far outside of all else"
        )
    steps = np.abs(np.diff(values))
    abrupt = max(
        ABRUPT * float(np.median(steps[steps > 0])), BITS * float(np.min(steps[steps > 0]))
    )
    for end, extreme in (("above", values.max()), ("below", values.min())):
        flat = np.diff(np.concatenate([[0], (values == extreme).astype(np.int8), [0]]))
        for start, stop in zip(np.nonzero(flat == 1)[0], np.nonzero(flat == -1)[0], strict=True):
            if stop - start >= FLAT and start > 3 and np.max(steps[start - 3 : start]) > abrupt:
                share = 100.0 * float(np.mean(values == extreme))
                found.append(
                    f"is cut off {end} {extreme:.6g} ({share:.2g} % of the ticks), "
                    f"first at {time[start]:.4g} s"
                )
                break
    return found


def _write(out: Path, wanted: Map, period: float, signals: dict[tuple[str, str], Array]) -> int:
    fields: dict[str, list[str]] = {}
    for topic, name in signals:
        fields.setdefault(topic, []).append(name)
    ticks = len(next(iter(signals.values())))
    names = {topic: tuple(each) for topic, each in fields.items()}
    with Writer(out, wanted.experiment, period, wanted.controller, wanted.machine, names) as writer:
        for start in range(0, ticks, BLOCK):
            part = slice(start, min(start + BLOCK, ticks))
            blocks = {
                topic.strip("/"): np.column_stack([signals[topic, name][part] for name in each])
                for topic, each in names.items()
            }
            writer.append(**blocks)
    return ticks
