"""One printed result of the thesis beside the computed one, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

SLACK = 0.51
"""Largest difference that agrees, in units of the last printed digit.

It is one half for rounding, and a little more for printed values that were rounded twice.
"""


@dataclass(frozen=True)
class Entry:
    """A printed result beside the computed one.

    Attributes
    ----------
    where : str
        Place in the thesis: `Table 5.1`, `§6.1.3`, `Figure 4.17`.
    what : str
        Quantity of that place.
    thesis, ours : str
        Printed and computed result. Over several seeds, the computed one is the median, followed
        by the 5th and 95th percentile.
    difference : str
        Computed minus printed value, or their ratio; empty for a statement.
    unit : str
        Unit of both values.
    rule : str
        Rule of the comparison.
    agrees : bool
        Whether the two agree by that rule.
    note : str
        Reason for a difference, or which of two contradictory printed results is right.
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
    """Return the value of a printed number, such as `-1.7e-5` or `0.00772`."""
    # The tables are quoted with the typographic minus sign.
    return float(printed.replace("−", "-"))


def last_digit(printed: str) -> float:
    """Return the weight of the last printed digit.

    It is 0.01 for `-98.06`, 1e-6 for `-1.7e-5` and 1 for `50`.
    """
    mantissa, _, exponent = printed.replace("−", "-").lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def digits(
    where: str, quantity: str, printed: str, ours: float, unit: str = "1", note: str = ""
) -> Entry:
    """Return an entry that agrees if the computed value rounds to the printed digits."""
    difference = ours - number(printed)
    agrees = abs(difference) <= SLACK * last_digit(printed)
    return Entry(
        where,
        quantity,
        printed,
        _format_like(printed, ours),
        f"{difference:+.2g}",
        unit,
        "printed digits",
        bool(agrees),
        note,
    )


def factor(
    where: str,
    quantity: str,
    printed: str,
    ours: Sequence[float] | np.ndarray,
    unit: str,
    within: float,
    note: str = "",
) -> Entry:
    """Return an entry that agrees if the median lies within a factor of the printed value.

    `ours` holds the computed values of all seeds, shape (seeds,).
    """
    median, text = _summarise(ours)
    ratio = median / number(printed)
    agrees = 1.0 / within <= ratio <= within
    return Entry(
        where,
        quantity,
        printed,
        text,
        f"x {ratio:.2f}",
        unit,
        f"factor {within:g}",
        bool(agrees),
        note,
    )


def band(
    where: str,
    quantity: str,
    printed: str,
    ours: Sequence[float] | np.ndarray,
    unit: str,
    within: float,
    note: str = "",
) -> Entry:
    """Return an entry of `factor` whose rule also names the 5 to 95 % band over the seeds.

    The rule says whether the printed value lies inside that band.
    """
    entry = factor(where, quantity, printed, ours, unit, within, note)
    # The printed value is one test on one road, so it may lie anywhere in the band of the seeds.
    low, high = np.percentile(ours, [5.0, 95.0])
    value, slack = number(printed), SLACK * last_digit(printed)
    inside = "in" if low - slack <= value <= high + slack else "outside"
    return replace(entry, rule=f"{entry.rule}, {inside} 5-95 %")


def statement(
    where: str, quantity: str, claim: str, holds: bool, ours: str, note: str = ""
) -> Entry:
    """Return an entry for a statement in words; holds: whether the computed results confirm it."""
    return Entry(where, quantity, claim, ours, "", "", "statement", bool(holds), note)


def count_agreeing(entries: Sequence[Entry]) -> str:
    """Return how many entries agree, such as `7 of 8`."""
    return f"{sum(entry.agrees for entry in entries)} of {len(entries)}"


def _format_like(printed: str, value: float) -> str:
    """Format a value with one digit more than a printed number has."""
    # One digit more shows why a value just misses the printed digits.
    if "e" in printed.lower():
        return f"{value:.{len(printed.lower().partition('e')[0].partition('.')[2]) + 1}e}"
    return f"{value:.{len(printed.partition('.')[2]) + 1}f}"


def _summarise(values: Sequence[float] | np.ndarray) -> tuple[float, str]:
    """Return the median of the seeds, and it as text with the 5th and 95th percentile."""
    median = float(np.median(values))
    if len(values) < 2:
        return median, f"{median:.4g}"
    low, high = np.percentile(values, [5.0, 95.0])
    return median, f"{median:.4g} ({low:.4g} to {high:.4g})"
