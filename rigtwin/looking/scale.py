"""Units in which a quantity's numbers are short enough to be read."""

from __future__ import annotations

import math

LEAST, LARGEST = 0.1, 1e5
"""Between which the largest number of a range is written in the unit itself."""
PREFIXED = {"s": "ms", "m": "mm", "V": "mV", "rad": "mrad"}
"""Unit → a thousandth of it."""


def shorten(largest: float, unit: str) -> tuple[float, str]:
    """A scale for numbers up to a size.

    Parameters
    ----------
    largest
        Of the numbers, in the unit.
    unit
        That they are in; "" or "1" for none.

    Returns
    -------
    tuple of float and str
        What they are multiplied by, and the unit then: the unit itself where they are neither long
        nor tiny, else a thousandth of it, or another power of a thousand before it.
    """
    unit = "" if unit == "1" else unit
    if not 0.0 < largest < math.inf or LEAST <= largest < LARGEST:
        return 1.0, unit
    power = 3 * math.floor((math.log10(largest) + 1.0) / 3.0)
    named = PREFIXED.get(unit) if power == -3 else None
    return 10.0**-power, named or f"1e{power} {unit}".strip()
