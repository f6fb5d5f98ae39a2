"""Channels computed from columns: unwrapped counters, and formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controllers.formula import Formula
from controllers.formula_program import (
    ABSOLUTE,
    ADD,
    CLIP,
    COSINE,
    DELAY,
    DERIVATIVE,
    DIVIDE,
    INTEGRAL,
    LARGER,
    LOW_PASS,
    MEAN,
    MULTIPLY,
    NEGATE,
    ROOT,
    SIGN,
    SINE,
    SMALLER,
    SUBTRACT,
)
from rigtwin.numerics.arrays import Array

BETWEEN, WIDEST = 0.005, 3
"""Smallest distance of an interpolated sample from the counter's end, as a share of its range, and
the largest number of adjacent interpolated samples."""


def _divide(dividend: Array | float, divisor: Array | float) -> Array | float:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.divide(dividend, divisor)


PLAIN: dict[int, Callable[..., Any]] = {
    ADD: np.add,
    SUBTRACT: np.subtract,
    MULTIPLY: np.multiply,
    DIVIDE: _divide,
    NEGATE: np.negative,
    ABSOLUTE: np.abs,
    SIGN: np.sign,
    SINE: np.sin,
    COSINE: np.cos,
    ROOT: lambda value: np.sqrt(np.maximum(value, 0.0)),
    SMALLER: np.minimum,
    LARGER: np.maximum,
    CLIP: np.clip,
}
"""Operation → function of whole columns."""
OPERANDS = {NEGATE: 1, ABSOLUTE: 1, SIGN: 1, SINE: 1, COSINE: 1, ROOT: 1, CLIP: 3}
"""Operation → number of its operands, unless that is two."""


def unwrap(counts: Array, wrap: float) -> tuple[Array, int]:
    """Return the continuous count of a counter that begins again after `wrap` counts.

    A step of more than half the range is a wrap. The first sample is signed: with 16 bits, 65 528
    is −8. A sample between the two ends whose neighbours lie at opposite ends was interpolated by
    the program that wrote the file; it is replaced by interpolating the continuous count.

    Parameters
    ----------
    counts
        Counter's samples, shape (rows,).
    wrap
        Range of the counter, counts.

    Returns
    -------
    array
        Continuous count, shape (rows,).
    int
        Number of replaced samples.
    """
    # Missing samples would break np.unwrap; the count is interpolated across them afterwards.
    rows = np.nonzero(np.isfinite(counts))[0]
    if len(rows) < WIDEST + 2:
        return counts, 0
    known = counts[rows]
    sound = np.ones(len(known), bool)
    # Interpolated samples stand in runs of at most WIDEST. A run is found by the jump across it.
    for width in range(1, WIDEST + 1):
        # Row k of `inner` are the samples between k and k + width + 1; `across` is the step
        # between those two.
        across = known[width + 1 :] - known[: -width - 1]
        inner = np.lib.stride_tricks.sliding_window_view(known[1:-1], width)
        away = np.abs(_nearest(inner - known[: -width - 1, None], wrap))
        between = (
            # Three signs of an interpolated wrap: its neighbours lie at opposite ends, it lies
            # far from both ends, and the true step, without the wrap, is small against that
            # distance.
            (np.abs(across) > 0.5 * wrap)
            & (np.min(away, axis=1) > BETWEEN * wrap)
            & (np.abs(_nearest(across, wrap)) < 0.2 * np.max(away, axis=1))
        )
        for place in np.nonzero(between)[0]:
            sound[place + 1 : place + 1 + width] = False
    turned = np.unwrap(known[sound], period=wrap)
    # Whole turns are removed so that the first sample lies within ± half the range.
    turned -= wrap * np.round(turned[0] / wrap)
    out = counts.copy()
    out[rows] = np.interp(rows, rows[sound], turned)
    return out, int(np.sum(~sound))


def _nearest(step: Array, wrap: float) -> Array:
    """Return a step without whole ranges of the counter: between −wrap/2 and wrap/2."""
    return step - wrap * np.round(step / wrap)


def evaluate(formula: Formula, columns: Mapping[str, Array], period: float) -> Array:
    """Return the values of a formula over whole columns.

    The functions have a controller's names but no phase lag: derivatives and means are centred, and
    a low pass runs forwards and backwards.

    Parameters
    ----------
    formula
        Formula of columns and constants.
    columns
        Input of the formula → column, shape (rows,).
    period
        Period of the rows, s.

    Returns
    -------
    array
        Values, shape (rows,).
    """
    program = formula.program
    rows = len(columns[formula.inputs[0]])
    registers: list[Array | float] = [columns[name] for name in formula.inputs]
    count = len(program.operations)
    # Registers are the inputs, then the constants, then one result for each operation.
    registers += program.registers[len(registers) : len(program.registers) - count].tolist()
    for code, *places, _ in program.operations.tolist():
        operands = [registers[place] for place in places]
        if code in PLAIN:
            registers.append(PLAIN[code](*operands[: OPERANDS.get(code, 2)]))
        else:
            length = float(np.asarray(operands[1]).flat[0])
            signal = np.broadcast_to(np.asarray(operands[0], float), (rows,))
            registers.append(_remember(code, signal, length, period))
    # A result may be a single number, such as a constant.
    return np.broadcast_to(np.asarray(registers[-1], float), (rows,)).copy()


def _remember(code: int, signal: Array, length: float, period: float) -> Array:
    """Return the result of an operation with memory, such as a derivative or a low pass."""
    # Importing scipy.signal takes a second, which only these formulas pay for.
    from scipy.ndimage import uniform_filter1d
    from scipy.signal import butter, sosfiltfilt

    if code == DERIVATIVE:
        return np.gradient(signal, period)
    if code == INTEGRAL:
        # Trapezoidal rule, with an integral of 0 at the first sample.
        return np.concatenate([[0.0], np.cumsum(0.5 * period * (signal[1:] + signal[:-1]))])
    if code == LOW_PASS:
        # butter() takes the corner as a share of the Nyquist frequency: 1/(2π·T) / (1/(2·period)).
        corner = min(period / (np.pi * max(length, 1e-12)), 0.99)
        return sosfiltfilt(butter(1, corner, output="sos"), signal)
    if code == MEAN:
        return uniform_filter1d(signal, max(int(length), 1), mode="nearest")
    assert code == DELAY
    ticks = min(int(length), len(signal))
    return np.concatenate([np.full(ticks, signal[0]), signal[: len(signal) - ticks]])
