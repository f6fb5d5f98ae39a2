"""Conversion between values, volts and the 16-bit codes of the card's converters.

Card, twin and virtual card use the same functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.hardware.daq.table import CardLine
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

CODES = 65536
"""Number of codes of a 16-bit converter."""


class Conversion(NamedTuple):
    """Scalings of several lines as arrays of shape (lines,).

    Attributes
    ----------
    factor
        Product of sign and scale, in the signal's unit per V.
    offset
        Value at 0 V, in the signal's unit.
    range
        Largest voltage, in V, in both directions.
    """

    factor: Array
    offset: Array
    range: Array


def conversion(lines: Sequence[CardLine]) -> Conversion:
    """Return the scalings of lines as arrays."""
    scalings = [line.scaling for line in lines]
    return Conversion(
        np.array([scaling.sign * scaling.scale for scaling in scalings]),
        np.array([scaling.offset for scaling in scalings]),
        np.array([scaling.range for scaling in scalings]),
    )


def rows(lines: Conversion) -> list[tuple[float, float, float]]:
    """Return factor, offset and range per line as tuples, which plain Python reads fastest."""
    return list(
        zip(lines.factor.tolist(), lines.offset.tolist(), lines.range.tolist(), strict=True)
    )


@compilable
def volts_of(lines: Conversion, values: Array, out: Array) -> None:
    """Convert values to voltages, both of shape (lines,), clipped to the lines' ranges."""
    # An explicit loop, because an array expression would allocate memory in every tick.
    for line in range(len(out)):
        volts = (values[line] - lines.offset[line]) / lines.factor[line]
        out[line] = min(max(volts, -lines.range[line]), lines.range[line])


@compilable
def values_of(lines: Conversion, volts: Array, out: Array) -> None:
    """Convert voltages to values, both of shape (lines,)."""
    for line in range(len(out)):
        out[line] = lines.factor[line] * volts[line] + lines.offset[line]


@compilable
def digitise(lines: Conversion, volts: Array, out: Array) -> None:
    """Round voltages, shape (lines,), to the codes of a 16-bit converter."""
    for line in range(len(out)):
        bit = 2.0 * lines.range[line] / CODES
        # Rounding to the nearest code is what an ideal converter does: its error is uniform
        # within ± half a code.
        # Two's complement: the most positive code is one step short of the range.
        code = min(max(float(np.rint(volts[line] / bit)), -CODES / 2.0), CODES / 2.0 - 1.0)
        out[line] = bit * code


to_volts = kernel(volts_of)
to_values = kernel(values_of)
to_bits = kernel(digitise)
