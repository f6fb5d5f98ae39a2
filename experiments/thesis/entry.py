"""One figure of the thesis beside ours, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

SLACK = 0.51
"""Of the last printed digit: a half, and a little for a printed value that was itself rounded
twice."""


@dataclass(frozen=True)
class Entry:
    """A figure as printed beside the one computed here.

    where: `Table 5.1`, `§6.1.3`, `Figure 4.17`; what: which of its figures; thesis: as printed;
    ours: as computed, low and high: of 5 and 95 % of the seeds where there are several; rule: how
    the two were compared; note: why they differ, or which of two printed figures is right.
    """

    where: str
    what: str
    thesis: str
    ours: str
    difference: str
    unit: str
    rule: str
    agrees: bool
    note: str = ""


def number(printed: str) -> float:
    """The value of a printed number: `-1.7e-5`, `0.00772`."""
    return float(printed.replace("−", "-"))


def last_digit(printed: str) -> float:
    """The weight of the last printed digit: 0.01 for `-98.06`, 1e-6 for `-1.7e-5`, 1 for `50`."""
    mantissa, _, exponent = printed.replace("−", "-").lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def digits(
    where: str, what: str, printed: str, ours: float, unit: str = "1", note: str = ""
) -> Entry:
    """Agrees if ours rounds to the printed digits."""
    difference = ours - number(printed)
    agrees = abs(difference) <= SLACK * last_digit(printed)
    return Entry(
        where,
        what,
        printed,
        _like(printed, ours),
        f"{difference:+.2g}",
        unit,
        "printed digits",
        bool(agrees),
        note,
    )


def factor(
    where: str,
    what: str,
    printed: str,
    ours: Sequence[float] | np.ndarray,
    unit: str,
    within: float,
    note: str = "",
) -> Entry:
    """Agrees if the median of ours is within a factor of the printed value. ours: over the
    seeds."""
    middle, text = _spread(ours)
    ratio = middle / number(printed)
    agrees = 1.0 / within <= ratio <= within
    return Entry(
        where, what, printed, text, f"x {ratio:.2f}", unit, f"factor {within:g}", bool(agrees), note
    )


def band(
    where: str,
    what: str,
    printed: str,
    ours: Sequence[float] | np.ndarray,
    unit: str,
    within: float,
    note: str = "",
) -> Entry:
    """As `factor`; the rule also says whether the printed value lies within the 5 to 95 % band of
    ours over the seeds."""
    entry = factor(where, what, printed, ours, unit, within, note)
    low, high = np.percentile(ours, [5.0, 95.0])
    value, slack = number(printed), SLACK * last_digit(printed)
    inside = "in" if low - slack <= value <= high + slack else "outside"
    return replace(entry, rule=f"{entry.rule}, {inside} 5-95 %")


def statement(where: str, what: str, says: str, holds: bool, ours: str, note: str = "") -> Entry:
    """A statement in words. holds: whether it is true here; ours: what was found."""
    return Entry(where, what, says, ours, "", "", "statement", bool(holds), note)


def share(entries: Sequence[Entry]) -> str:
    """How many agree: `7 of 8`."""
    return f"{sum(entry.agrees for entry in entries)} of {len(entries)}"


def _like(printed: str, value: float) -> str:
    """With one digit more than printed."""
    if "e" in printed.lower():
        return f"{value:.{len(printed.lower().partition('e')[0].partition('.')[2]) + 1}e}"
    return f"{value:.{len(printed.partition('.')[2]) + 1}f}"


def _spread(values: Sequence[float] | np.ndarray) -> tuple[float, str]:
    middle = float(np.median(values))
    if len(values) < 2:
        return middle, f"{middle:.4g}"
    low, high = np.percentile(values, [5.0, 95.0])
    return middle, f"{middle:.4g} ({low:.4g} to {high:.4g})"
