"""The gap over time: measured less predicted, in units of what noise and tolerances explain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft
from numpy.typing import NDArray

from rigtwin.diagnosis.evidence import Evidence, Lines
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

BANDS = ((0.0, 2.0), (2.0, 8.0), (8.0, 30.0), (30.0, 150.0))
"""Hz; a gap shows in one of them long before it shows in all."""
CLEAR = 2.0
"""Standard deviations of what noise leaves, beyond which tolerances are asked."""


@dataclass(frozen=True)
class Gap:
    """Of one stretch of a test.

    time: s, shape (ticks,); measured, predicted: shape (signals, ticks); power: of the whitened
    difference less what tolerances take up, in each band, of mean 1 or less if nothing is wrong,
    shape (signals, bands, ticks); counts: ticks that are judged, shape (signals, ticks); freedom:
    independent squares a tick, shape (signals, bands).
    """

    time: Array
    measured: Array
    predicted: Array
    power: Array
    counts: NDArray[np.bool_]
    freedom: Array


def find_gap(evidence: Evidence) -> Gap:
    """The gap of one recording.

    Parameters
    ----------
    evidence
        Of that recording alone, about the twin that it is held against.

    Returns
    -------
    Gap
        Of all its ticks.
    """
    lines = evidence.lines[0]
    predicted = evidence.predict(evidence.plant)[0]
    residual = evidence.residual_of([predicted])
    freedom, counts = _freedom(lines), lines.fade > 0.5
    power = _powers(lines, residual)
    if evidence.machine.tolerances and _is_large(power, counts, freedom):
        residual = Space(evidence, evidence.plant).subtract_tolerances(residual)
        power = _powers(lines, residual)
    time = float(evidence.recordings[0].time[0])
    return Gap(
        time=time + lines.period * np.arange(lines.measured.shape[1]),
        measured=lines.measured,
        predicted=predicted,
        power=power,
        counts=counts,
        freedom=freedom,
    )


def _is_large(power: Array, counts: NDArray[np.bool_], freedom: Array) -> bool:
    """Whether any signal has more power in a band than noise alone may leave it, so that what
    tolerances take up matters."""
    found = np.sum(np.where(counts[:, None], power, 0.0), axis=2)
    expected = freedom * counts.sum(axis=1)[:, None]
    spread = np.sqrt(2.0 * expected)
    return bool(np.any(found > expected + CLEAR * spread))


def _in_bands(lines: Lines) -> NDArray[np.bool_]:
    """Which lines lie in which band, shape (bands, lines)."""
    return np.array([(lines.frequency >= low) & (lines.frequency < high) for low, high in BANDS])


def _powers(lines: Lines, residual: Array) -> Array:
    """Power over time of what a whitened residual has in each band."""
    rows, ticks = lines.measured.shape
    real, imaginary = residual.reshape(2, rows, len(lines.frequency))
    whole = np.zeros((rows, len(BANDS), lines.length // 2 + 1), complex)
    whole[:, :, : real.shape[1]] = (real + 1j * imaginary)[:, None, :] * _in_bands(lines)
    # Parts of a line have variance 1 if all ticks that count are taken together.
    share = np.sum(lines.fade**2, axis=1) / lines.length
    traces = irfft(whole, lines.length, axis=2)[:, :, :ticks]
    return traces**2 * (0.5 * lines.length * share)[:, None, None]


def _freedom(lines: Lines) -> Array:
    """Independent squares a tick: two a line that is there, spread over all ticks."""
    kept = _in_bands(lines)[None] & (lines.weight > 0.0)[:, None, :]
    return 2.0 * kept.sum(axis=2) / lines.length


def ratio(gap: Gap, ticks: slice) -> Array:
    """Times what is explained, by signal, over a stretch: all bands together.

    Parameters
    ----------
    gap
        Of a stretch that holds it.
    ticks
        The stretch.

    Returns
    -------
    array
        Root of the power in units of what noise and tolerances explain, shape (signals,); 0 where
        nothing is judged.
    """
    counts = gap.counts[:, ticks]
    power = np.sum(np.where(counts, gap.power[:, :, ticks].sum(axis=1), 0.0), axis=1)
    expected = gap.freedom.sum(axis=1) * counts.sum(axis=1)
    return np.array(
        [math.sqrt(p / e) if e > 0.0 else 0.0 for p, e in zip(power, expected, strict=True)]
    )
