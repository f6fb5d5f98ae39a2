"""The time of a log's rows: which column it is, in what unit, and whether its steps are even."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigtwin.describing.heading import split_words
from rigtwin.describing.quantity import COMMANDED, TIME, TIME_UNITS, WORDS
from rigtwin.describing.question import ask, enumerate_names, option
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.timing import (
    JITTER,
    MOST_OFF,
    find_period,
    interpolate,
    is_held,
    most_off,
)
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import white_noise

SLOWEST, FASTEST = 0.15, 1e-4
"""s; steps of a log of a machine's motion are taken to lie between."""
SLIGHT, SMOOTHER, ROUGHER = 0.01, 0.65, 1.2
"""Deviation of a step, as a share of the period, below which time stamps are even; and ratios of
the roughness by the time stamps to that by rows: below the first in one column and the second in
all, the rows were sampled when their stamps say."""
UNITS = ("s", "ms", "us", "ns")
FEWEST, UNEVEN = 50, 0.5
"""Smallest number of rows, and largest deviation of a step as a share of the median step, of a
column that is taken as the time although its name does not say so."""
QUANTITIES = frozenset().union(COMMANDED, *WORDS.values())
"""Words by which a column names another quantity."""


@dataclass(frozen=True)
class Clock:
    """Time base of a log.

    Parameters
    ----------
    column
        Column of the time; empty where the period is stated instead.
    unit
        Unit of the column.
    period
        Typical step, s.
    resample
        Period to which uneven rows are resampled, s; None where the steps are even.
    why
        Reason for the column and its unit, for the printed table.
    assumed
        Whether the unit or the column was concluded and not stated.
    """

    column: str
    unit: str
    period: float
    resample: float | None
    why: str
    assumed: bool


def find_clock(columns: Columns, stated: str = "") -> Clock:
    """Return the time base of a log.

    Parameters
    ----------
    columns
        Columns of the log.
    stated
        Answer of the log's owner: a column, with its unit in brackets where the log does not
        state it, or the period in s; empty if there was none.

    Raises
    ------
    Question
        If no column, or more than one, can be the time, or if two units are possible.
    """
    try:
        # A plain number is a period; anything else names a column.
        period = float(stated)
    except ValueError:
        pass
    else:
        if not 1e-6 <= period <= 10.0:
            raise RigtwinError(f"--column time={stated}: expected a period from 1e-6 to 10 s")
        return Clock("", "s", period, None, "period as stated", False)
    unit, reason = "", ""
    if stated:
        column, unit = _split(stated)
    else:
        column, reason = _find_column(columns)
    if column not in columns.values:
        raise RigtwinError(
            f"--column time={stated}: no column {column!r}; there are {', '.join(columns.values)}"
        )
    broken = ~np.isfinite(columns.values[column])
    if broken.any():
        where = columns.wrong.get(column) or f"row {int(np.argmax(broken)) + 1}"
        raise RigtwinError(f"time column {column!r} is not a number in {where}")
    steps = _steps(column, columns.values[column])
    unit, why, assumed = _unit(column, unit, columns, steps)
    if reason:
        why, assumed = f"{reason}; {why}", True
    factor = unit_of(unit)[1]
    time = factor * columns.values[column]
    # Rows that repeat a time stamp say nothing of the period.
    moving = np.diff(time, prepend=-np.inf) > 0.0
    period = find_period(time[moving])
    stamps = time[moving]
    uneven = np.abs(np.diff(stamps) - period) > JITTER * period
    is_uneven = bool(uneven.any()) or most_off(stamps) > MOST_OFF * period
    is_uneven = is_uneven or _stamps_tell(stamps, period, moving, columns, column)
    return Clock(column, unit, period, period if is_uneven else None, why, assumed)


def _stamps_tell(
    stamps: Array, period: float, moving: NDArray[np.bool_], columns: Columns, column: str
) -> bool:
    """Return whether rows of a slightly uneven time were sampled when their stamps say.

    A loop that runs early or late samples at uneven times, and a message that waits in a queue
    only bears an uneven stamp. A motion is smooth in the time at which it was sampled.

    Parameters
    ----------
    stamps
        Rising time stamps, s, shape (kept rows,).
    period
        Typical step, s.
    moving
        Whether a row is kept, shape (rows,).
    columns
        Columns of the log.
    column
        Column of the time.
    """
    if np.max(np.abs(np.diff(stamps) - period)) < SLIGHT * period:
        return False
    ticks = np.arange(stamps[0], stamps[-1], period)
    ratios = []
    for name, values in columns.values.items():
        kept = values[moving]
        if name == column or not np.isfinite(kept).all() or is_held(kept):
            continue
        if (by_row := white_noise(kept)) > 0.0:
            ratios.append(white_noise(interpolate(stamps, kept, ticks, np.inf)) / by_row)
    # Where noise hides the motion's smoothness the spline still averages it, to about 0.8.
    return bool(ratios) and min(ratios) < SMOOTHER and max(ratios) < ROUGHER


def _split(stated: str) -> tuple[str, str]:
    """A column and its unit, which can stand in brackets behind it."""
    column, bracket, unit = stated.partition("[")
    return column.strip(), unit.rstrip("] ").strip() if bracket else ""


def _find_column(columns: Columns) -> tuple[str, str]:
    """The column of the time, and why it is that one where its name does not say so."""
    named, falling = [], []
    for column, values in columns.values.items():
        words = split_words(column)
        telling = [word for word in words if word not in TIME_UNITS or word in TIME]
        # "joint_s" has a unit of time for a word, but does not say that it is one; "ms" does, and
        # "s" may be a distance.
        alone = len(words) == 1 and words[0] in TIME_UNITS and len(words[0]) > 1
        if (telling and set(words) & TIME) or alone:
            if _rises(values):
                # The fewest words win: "time" before "time_of_day", and before "ms".
                named.append((len(telling) or 2, column))
            elif len(words) == len(telling) == 1:
                falling.append(column)
    named.sort()
    if len(named) > 1 and named[0][0] == named[1][0]:
        names = [column for _, column in named]
        raise ask(
            f"columns {enumerate_names(names)} could be the time; which is it?",
            *(option("time", name) for name in names[:3]),
        )
    if named:
        return named[0][1], ""
    steps = np.diff(columns.values[falling[0]]) if falling else np.zeros(0)
    if (steps < 0.0).any():
        # Two: rows count from 1, and the step belongs to the row that it leads to.
        row = int(np.argmax(steps < 0.0)) + 2
        raise RigtwinError(
            f"time column {falling[0]!r} goes back in row {row}; several runs in one file? "
            "expected one run, or a column such as 'episode' that numbers them, with a whole "
            "number in each row"
        )
    even = [
        column
        for column, values in columns.values.items()
        if not set(split_words(column)) & QUANTITIES and _rises_evenly(values)
    ]
    if len(even) == 1:
        return even[0], "no column is named as the time, and this one alone rises evenly"
    raise ask(
        "no column is named as the time; which is it, or what is the period of the rows in s",
        option("time", "COLUMN"),
        option("time", "0.002"),
    )


def _rises(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 2 and bool(np.all(np.diff(known) >= 0.0)) and known[-1] > known[0]


def _rises_evenly(values: Array) -> bool:
    """Whether a column rises as a time does, and holds no whole numbers, which may count rows."""
    if not np.isfinite(values).all() or len(values) < FEWEST or np.all(values == np.round(values)):
        return False
    steps = np.diff(values)
    step = float(np.median(steps))
    return step > 0.0 and bool(np.all(np.abs(steps - step) < UNEVEN * step))


def _steps(column: str, values: Array) -> float:
    """Typical step in the column's own unit."""
    steps = np.diff(values[np.isfinite(values)])
    steps = steps[steps > 0.0]
    if not len(steps):
        raise RigtwinError(f"time column {column!r} does not rise")
    return float(np.median(steps))


def _unit(column: str, unit: str, columns: Columns, step: float) -> tuple[str, str, bool]:
    """Unit of the time column, the reason, and whether it was concluded."""
    if unit:
        if unit_of(unit)[0] != "s":
            raise RigtwinError(f"--column time={column} [{unit}]: expected a unit of time")
        return unit, "as stated", False
    if column in columns.units:
        return columns.units[column], "unit as the file says", False
    # A single word such as t or ms names the time rather than its unit.
    words = [word for word in split_words(column) if word in TIME_UNITS]
    if words and len(split_words(column)) > 1 and words[-1] != "sec":
        return TIME_UNITS[words[-1]], "unit by the column's name", False
    # The bounds are a factor of 1500 apart, and the units 1000: two of them can fit.
    fits = [each for each in UNITS if FASTEST <= unit_of(each)[1] * step <= SLOWEST]
    if len(fits) == 1:
        seconds = unit_of(fits[0])[1] * step
        return fits[0], f"unit by its step of {step:.4g}: a row every {seconds:.4g} s", True
    raise ask(
        f"time column {column!r} rises by {step:.4g} a row; in what unit is it?",
        *(option("time", f"{column} [{each}]") for each in (fits or UNITS[:3])),
    )
