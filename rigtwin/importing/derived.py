"""Channels that are worked out from columns: counters that wrap around, and formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controllers.formula import (
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
    Formula,
)
from rigtwin.numerics.arrays import Array

BETWEEN, WIDEST = 0.005, 3
"""Share of a counter's range by which samples that were interpolated lie off its end, and how many
of them stand side by side at most."""


def _divide(one: Array | float, two: Array | float) -> Array | float:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.divide(one, two)


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
    ROOT: lambda one: np.sqrt(np.maximum(one, 0.0)),
    SMALLER: np.minimum,
    LARGER: np.maximum,
    CLIP: np.clip,
}
"""Operation → what it does to whole columns."""
OPERANDS = {NEGATE: 1, ABSOLUTE: 1, SIGN: 1, SINE: 1, COSINE: 1, ROOT: 1, CLIP: 3}
"""How many it takes, where that is not two."""


def unwrap(counts: Array, wrap: float) -> tuple[Array, int]:
    """What a counter of so many counts has counted.

    Steps of more than half of them are taken for passing the end, and the first sample for a signed
    one: of 16 bits, 65 528 is −8. A sample between the two ends, where both of its neighbours are
    at them, was interpolated by whoever wrote the file; it is bridged.

    Parameters
    ----------
    counts
        Shape (rows,).
    wrap
        After how many counts it begins again.

    Returns
    -------
    array
        Shape (rows,).
    int
        How many samples were bridged.
    """
    rows = np.nonzero(np.isfinite(counts))[0]
    if len(rows) < WIDEST + 2:
        return counts, 0
    known = counts[rows]
    sound = np.ones(len(known), bool)
    for width in range(1, WIDEST + 1):
        across = known[width + 1 :] - known[: -width - 1]
        inner = np.lib.stride_tricks.sliding_window_view(known[1:-1], width)
        away = np.abs(_nearest(inner - known[: -width - 1, None], wrap))
        between = (
            (np.abs(across) > 0.5 * wrap)
            & (np.min(away, axis=1) > BETWEEN * wrap)
            & (np.abs(_nearest(across, wrap)) < 0.2 * np.max(away, axis=1))
        )
        for place in np.nonzero(between)[0]:
            sound[place + 1 : place + 1 + width] = False
    turned = np.unwrap(known[sound], period=wrap)
    turned -= wrap * np.round(turned[0] / wrap)
    out = counts.copy()
    out[rows] = np.interp(rows, rows[sound], turned)
    return out, int(np.sum(~sound))


def _nearest(step: Array, wrap: float) -> Array:
    """The same step, whole turns less, between minus and plus half a turn."""
    return step - wrap * np.round(step / wrap)


def evaluate(formula: Formula, columns: Mapping[str, Array], period: float) -> Array:
    """A formula over whole columns.

    The words are a controller's, but nothing is late here: a derivative and a mean are taken about
    each row, a low pass goes forth and back.

    Parameters
    ----------
    formula
        Of columns and constants.
    columns
        Every input that it has, shape (rows,) each.
    period
        Of a row, s.

    Returns
    -------
    array
        Shape (rows,).
    """
    program = formula.program
    rows = len(columns[formula.inputs[0]])
    registers: list[Array | float] = [columns[name] for name in formula.inputs]
    count = len(program.operations)
    registers += program.registers[len(registers) : len(program.registers) - count].tolist()
    for code, *places, _ in program.operations.tolist():
        given = [registers[place] for place in places]
        if code in PLAIN:
            registers.append(PLAIN[code](*given[: OPERANDS.get(code, 2)]))
        else:
            length = float(np.asarray(given[1]).flat[0])
            registers.append(_remember(code, np.asarray(given[0], float), length, period))
    return np.broadcast_to(np.asarray(registers[-1], float), (rows,)).copy()


def _remember(code: int, signal: Array, length: float, period: float) -> Array | float:
    """What needs more than a row."""
    from scipy.ndimage import uniform_filter1d  # Late, as scipy.signal below.
    from scipy.signal import butter, sosfiltfilt

    if signal.ndim == 0:
        return 0.0 if code == DERIVATIVE else float(signal)
    if code == DERIVATIVE:
        return np.gradient(signal, period)
    if code == INTEGRAL:
        return np.concatenate([[0.0], np.cumsum(0.5 * period * (signal[1:] + signal[:-1]))])
    if code == LOW_PASS:
        corner = min(period / (np.pi * max(length, 1e-12)), 0.99)
        return sosfiltfilt(butter(1, corner, output="sos"), signal)
    if code == MEAN:
        return uniform_filter1d(signal, max(int(length), 1), mode="nearest")
    assert code == DELAY
    ticks = min(int(length), len(signal))
    return np.concatenate([np.full(ticks, signal[0]), signal[: len(signal) - ticks]])
