"""Gap over time: measured minus predicted, in units of what noise and tolerances explain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft
from numpy.typing import NDArray

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.lines import Lines
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

BANDS = ((0.0, 2.0), (2.0, 8.0), (8.0, 30.0), (30.0, 150.0))
"""Frequency bands in Hz. A gap shows in one band long before it shows in the total."""
CLEAR = 2.0
"""Number of standard deviations above the noise level from which tolerances are subtracted."""


@dataclass(frozen=True)
class GapTrace:
    """Gap over a stretch of a test.

    Attributes
    ----------
    time
        Times in s, shape (ticks,).
    measured, predicted
        Signals, shape (signals, ticks).
    power
        Power of the whitened residual after subtraction of tolerances, with mean 1 or less without
        a fault, shape (signals, bands, ticks).
    counts
        Ticks that are judged, shape (signals, ticks).
    freedom
        Independent squares per tick, shape (signals, bands).
    """

    time: Array
    measured: Array
    predicted: Array
    power: Array
    counts: NDArray[np.bool_]
    freedom: Array


def find_gap(evidence: Evidence) -> GapTrace:
    """Return the gap of one recording.

    Parameters
    ----------
    evidence
        Evidence of that recording alone, about the twin it is compared with.

    Returns
    -------
    GapTrace
        Gap at all ticks of the recording.
    """
    lines = evidence.lines[0]
    predicted = evidence.predict(evidence.plant)[0]
    residual = evidence.residual_of([predicted])
    freedom, counts = _freedom(lines), lines.counts
    power = _powers(lines, residual)
    # Subtracting tolerances needs many predictions, so it is done only if noise cannot explain it.
    if evidence.machine.tolerances and _is_large(power, counts, freedom):
        residual = Space(evidence, evidence.plant).subtract_tolerances(residual)
        power = _powers(lines, residual)
    time = float(evidence.recordings[0].time[0])
    return GapTrace(
        time=time + lines.period * np.arange(lines.measured.shape[1]),
        measured=lines.measured,
        predicted=predicted,
        power=power,
        counts=counts,
        freedom=freedom,
    )


def _is_large(power: Array, counts: NDArray[np.bool_], freedom: Array) -> bool:
    """Return whether any signal has more power in a band than noise alone may cause."""
    observed = np.sum(np.where(counts[:, None], power, 0.0), axis=2)
    expected = freedom * counts.sum(axis=1)[:, None]
    # A sum of n squares of unit normals has variance 2 n.
    spread = np.sqrt(2.0 * expected)
    return bool(np.any(observed > expected + CLEAR * spread))


def _in_bands(lines: Lines) -> NDArray[np.bool_]:
    """Return which spectral lines lie in which band, shape (bands, lines)."""
    return np.array([(lines.frequency >= low) & (lines.frequency < high) for low, high in BANDS])


def _powers(lines: Lines, residual: Array) -> Array:
    """Return the power over time of a whitened residual in each band.

    The spectrum is cut into bands, and each band is transformed back to a signal over time.
    """
    rows, ticks = lines.measured.shape
    # Evidence keeps real and imaginary parts one after the other, since least squares are real.
    real, imaginary = residual.reshape(2, rows, len(lines.frequency))
    whole = np.zeros((rows, len(BANDS), lines.length // 2 + 1), complex)
    # The bands are disjoint: by Parseval's theorem their powers, summed over time, add up to the
    # total.
    whole[:, :, : real.shape[1]] = (real + 1j * imaginary)[:, None, :] * _in_bands(lines)
    # Real and imaginary parts of a line have variance 1 only if all ticks count.
    share = np.sum(lines.fade**2, axis=1) / lines.length
    traces = irfft(whole, lines.length, axis=2)[:, :, :ticks]
    return traces**2 * (0.5 * lines.length * share)[:, None, None]


def _freedom(lines: Lines) -> Array:
    """Return the independent squares per tick: two per spectral line, spread over all ticks."""
    present = _in_bands(lines)[None] & (lines.weight > 0.0)[:, None, :]
    return 2.0 * present.sum(axis=2) / lines.length


def ratio(gap: GapTrace, ticks: slice) -> Array:
    """Return the gap of each signal over a stretch, with all bands together.

    Parameters
    ----------
    gap
        Gap of a recording that contains the stretch.
    ticks
        Ticks of the stretch.

    Returns
    -------
    array
        RMS in units of what noise and tolerances explain, shape (signals,); 0 if nothing is
        judged.
    """
    counts = gap.counts[:, ticks]
    power = np.sum(np.where(counts, gap.power[:, :, ticks].sum(axis=1), 0.0), axis=1)
    expected = gap.freedom.sum(axis=1) * counts.sum(axis=1)
    return np.array(
        [math.sqrt(p / e) if e > 0.0 else 0.0 for p, e in zip(power, expected, strict=True)]
    )
