"""Values to volts and back, and the card's 16 bits in between.

The same for client, twin and virtual card.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.hardware.daq.table import Line
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

CODES = 65536
"""Of 16 bits."""


class Conversion(NamedTuple):
    """Scalings of several lines, each of shape (lines,).

    Factor = sign · scale in unit/V, offset in the unit, range in V.
    """

    factor: Array
    offset: Array
    range: Array


def conversion(lines: Sequence[Line]) -> Conversion:
    scalings = [line.scaling for line in lines]
    return Conversion(
        np.array([scaling.sign * scaling.scale for scaling in scalings]),
        np.array([scaling.offset for scaling in scalings]),
        np.array([scaling.range for scaling in scalings]),
    )


def rows(lines: Conversion) -> list[tuple[float, float, float]]:
    """Factor, offset and range of each line, as Python reads them fastest."""
    return list(
        zip(lines.factor.tolist(), lines.offset.tolist(), lines.range.tolist(), strict=True)
    )


@compilable
def volts_of(lines: Conversion, values: Array, out: Array) -> None:
    """The voltages that stand for values, both of shape (lines,), not beyond the lines' ranges."""
    for line in range(len(out)):
        volts = (values[line] - lines.offset[line]) / lines.factor[line]
        out[line] = min(max(volts, -lines.range[line]), lines.range[line])


@compilable
def values_of(lines: Conversion, volts: Array, out: Array) -> None:
    """What voltages stand for, both of shape (lines,)."""
    for line in range(len(out)):
        out[line] = lines.factor[line] * volts[line] + lines.offset[line]


@compilable
def digitise(lines: Conversion, volts: Array, out: Array) -> None:
    """Voltages as 16 bits hold them, both of shape (lines,)."""
    for line in range(len(out)):
        bit = 2.0 * lines.range[line] / CODES
        code = min(max(float(np.rint(volts[line] / bit)), -CODES / 2.0), CODES / 2.0 - 1.0)
        out[line] = bit * code


to_volts = kernel(volts_of)
to_values = kernel(values_of)
to_bits = kernel(digitise)
