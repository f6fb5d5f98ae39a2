"""Dates and times of day, as loggers write them, in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from dateutil import parser

from rigtwin.numerics.arrays import Array

DAY = 86_400.0
"""Duration of a day, s."""
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*([ap]m)?", re.IGNORECASE)
_ISO = re.compile(r"\d{4}-\d{2}-\d{2}([T ].*)?")
_DATE = re.compile(r"\d{1,4}[./-](\d{1,2}|[A-Za-z]{3,9})[./-]\d{2,4}(\D.*)?")
_LEADING = re.compile(r"(\d{1,2})([./-])(\d{1,2})[./-]")


def clock_of(cell: str) -> float | None:
    """Return a time of day in s since midnight; None for any other cell."""
    match = _CLOCK.fullmatch(cell.strip())
    if match is None:
        return None
    hours, minutes, seconds, half = match.groups()
    # 12 a.m. is midnight and 12 p.m. noon, hence modulo 12.
    hour = int(hours) % 12 + 12 * (half.lower() == "pm") if half else int(hours)
    return 3600.0 * hour + 60.0 * int(minutes) + float((seconds or "0").replace(",", "."))


def stamps_of(cells: Sequence[str]) -> Array | None:
    """Return dates or times of day in s.

    Times of day continue past midnight. A date without a time zone is read as UTC, so that
    no daylight-saving change falls into the recording.

    Parameters
    ----------
    cells
        Cells of one column.

    Returns
    -------
    array or None
        Times, s, shape (rows,); None if a cell is neither a date nor a time of day.
    """
    clocks = [clock_of(cell) for cell in cells]
    if all(clock is not None for clock in clocks):
        return np.unwrap(np.array(clocks, float), period=DAY)
    first = _is_day_first(cells)
    dates = [_date(cell.strip(), first) for cell in cells]
    return None if any(date is None for date in dates) else np.array(dates, float)


def _is_day_first(cells: Sequence[str]) -> bool:
    """Return whether 3/4 is the third of April rather than the fourth of March.

    Dots, or a first number above 12, mean that the day comes first. A second number above 12, or
    a.m. or p.m., means that the month comes first. Otherwise the number that varies more is the
    day.
    """
    pairs = [match for cell in cells if (match := _LEADING.match(cell.strip()))]
    if not pairs:
        return True
    if pairs[0].group(2) == "." or any(int(pair.group(1)) > 12 for pair in pairs):
        return True
    if any(int(pair.group(3)) > 12 for pair in pairs):
        return False
    if any(cell.strip().lower().endswith("m") for cell in cells):
        return False
    days = [(int(pair.group(1)), int(pair.group(3))) for pair in pairs]
    # A recording spans more days than months, so the number that varies more is the day.
    return len({month for _, month in days}) <= len({month for month, _ in days})


def _date(cell: str, day_first: bool) -> float | None:
    try:
        if _ISO.fullmatch(cell):
            # Loggers of some countries write a decimal comma in the seconds.
            date = datetime.fromisoformat(cell.replace(",", "."))
        elif _DATE.fullmatch(cell):
            date = parser.parse(cell.replace(",", "."), dayfirst=day_first)
        else:
            return None
    except (ValueError, OverflowError):
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
