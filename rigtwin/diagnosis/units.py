"""Quantities in the units that engineers write: kN, mm, µm, ms, degrees.

Computation and files use SI units. Only texts, tables and axes convert.
"""

from __future__ import annotations

import math

SHORT_FROM, SHORT_BELOW = 1e-2, 1e4
"""Magnitudes between which a number is short enough to be written in SI units."""


def find_unit(unit: str, largest: float) -> tuple[float, str]:
    """Choose the unit for a signal.

    Parameters
    ----------
    unit
        SI unit of the signal; "1" for a ratio.
    largest
        Greatest magnitude of the signal, in `unit`.

    Returns
    -------
    tuple
        Factor by which SI values are multiplied, and the unit of the product.
    """
    base, _, rest = unit.partition("/")
    rest = f"/{rest}" if rest else ""
    if base == "rad":
        return 180.0 / math.pi, f"°{rest}"
    # A length of 1 m or more is read in metres, one below 10 µm in micrometres.
    if base == "m" and 0.0 < largest < 1e-5:
        return 1e6, f"µm{rest}"
    if base == "m" and largest < 1.0:
        return 1e3, f"mm{rest}"
    if unit == "s" and 0.0 < largest < 0.1:
        return 1e3, "ms"
    # The units of force and torque all begin with N.
    if base and (base[0] == "N" or base == "Pa") and largest >= SHORT_BELOW:
        return 1e-3, f"k{base}{rest}"
    return 1.0, "" if unit == "1" else unit


def shorten(unit: str, *values: float) -> tuple[float, str]:
    """Choose one unit for several numbers: SI, unless the greatest of them is long in SI.

    Parameters
    ----------
    unit
        SI unit of the numbers; "1" for a ratio.
    *values
        Numbers that share the unit. Infinite ones and NaN are ignored.

    Returns
    -------
    tuple
        Factor by which SI values are multiplied, and the unit of the product.
    """
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if largest == 0.0 or SHORT_FROM <= largest < SHORT_BELOW:
        return 1.0, "" if unit == "1" else unit
    return find_unit(unit, largest)


def say(value: float, unit: str) -> str:
    """Write an amplitude of a signal with its unit, to three digits."""
    factor, shown = find_unit(unit, abs(value))
    return f"{spell(factor * value, 3)} {shown}".rstrip()


def write(value: float, unit: str) -> str:
    """Write a parameter's value with its unit, to four digits."""
    factor, shown = shorten(unit, value)
    return f"{spell(factor * value, 4)} {shown}".rstrip()


def spell(value: float, digits: int) -> str:
    """Write a number to the given number of digits, without an exponent below a million.

    Python's `g` format writes 102 to two digits as 1.0e+02; a reader expects 102.
    """
    value += 0.0  # Adding zero turns -0.0 into 0.0.
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text
