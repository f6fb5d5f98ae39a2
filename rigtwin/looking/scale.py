"""Units in which a quantity's numbers are short enough to read."""

from __future__ import annotations

import math

LEAST, LARGEST = 0.1, 1e5
"""Range of the largest number that is written in the unit itself."""
PREFIXED = {"s": "ms", "m": "mm", "V": "mV", "rad": "mrad"}
"""Unit → its thousandth."""


def shorten(largest: float, unit: str) -> tuple[float, str]:
    """Return the scale and the unit for numbers up to a size.

    Parameters
    ----------
    largest
        Largest number, in the unit.
    unit
        Unit of the numbers; "" or "1" for none.

    Returns
    -------
    tuple of float and str
        Factor for the numbers, and their unit after it: the unit itself, a thousandth of it, or
        the unit with another power of a thousand in front.
    """
    unit = "" if unit == "1" else unit
    # Zero, infinity and NaN have no power of ten.
    if not 0.0 < largest < math.inf or LEAST <= largest < LARGEST:
        return 1.0, unit
    # The next lower power of 1000 that leaves at least one digit before the point.
    power = 3 * math.floor((math.log10(largest) + 1.0) / 3.0)
    named = PREFIXED.get(unit) if power == -3 else None
    return 10.0**-power, named or f"1e{power} {unit}".strip()
