"""Sizes in the units that engineers write them in. Inside and in files everything is SI."""

from __future__ import annotations

import math

FEWEST, MOST = 1e-2, 1e4
"""Between these a number is short in SI."""


def find_unit(unit: str, largest: float) -> tuple[float, str]:
    """The unit that engineers write a signal of this size in.

    Parameters
    ----------
    unit
        Of the signal, SI.
    largest
        Its greatest magnitude, in that unit.

    Returns
    -------
    tuple
        What its values are multiplied by, and the unit they then have.
    """
    base, _, rest = unit.partition("/")
    rest = f"/{rest}" if rest else ""
    if base == "rad":
        return 180.0 / math.pi, f"°{rest}"
    if base == "m" and 0.0 < largest < 1e-5:
        return 1e6, f"µm{rest}"
    if base == "m" and largest < 1.0:
        return 1e3, f"mm{rest}"
    if unit == "s" and 0.0 < largest < 0.1:
        return 1e3, "ms"
    if base and (base[0] == "N" or base == "Pa") and largest >= MOST:
        return 1e-3, f"k{base}{rest}"
    return 1.0, "" if unit == "1" else unit


def shorten(unit: str, *values: float) -> tuple[float, str]:
    """The unit for numbers in a text: SI, unless the greatest of them is long in it."""
    largest = max((abs(each) for each in values if math.isfinite(each)), default=0.0)
    if largest == 0.0 or FEWEST <= largest < MOST:
        return 1.0, "" if unit == "1" else unit
    return find_unit(unit, largest)


def say(value: float, unit: str, largest: float | None = None) -> str:
    """A size of a signal with its unit, three digits. largest: greatest value of its table, which
    the unit suits; by default the value itself."""
    factor, shown = find_unit(unit, abs(value) if largest is None else largest)
    return f"{spell(factor * value, 3)} {shown}".rstrip()


def write(value: float, unit: str, largest: float | None = None) -> str:
    """A value with its unit, four digits. largest: greatest value of its table, which the unit
    suits; by default the value itself."""
    factor, shown = shorten(unit, value if largest is None else largest)
    return f"{spell(factor * value, 4)} {shown}".rstrip()


def spell(value: float, digits: int) -> str:
    """A number with so many digits, and no exponent where it would be shorter without: 102, not
    1.0e+02."""
    value += 0.0  # minus zero is zero
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text
