"""The nine evaluation criteria J1 to J9 of the benchmark."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import correlate

from experiments.rths.building import PERIOD
from rigtwin.numerics.arrays import Array

LONGEST = 0.1
"""Longest delay that J1 considers, s."""


class Criteria(NamedTuple):
    """Criteria of one test: J1 in ms, J2 to J9 in %.

    J1 is the delay of the actuator. J2 and J3 are the tracking error, rms and peak; J4 and J5 the
    error of the first floor against the reference. J6 to J9 are the errors of the second and third
    floor, rms and then peak.
    """

    j1: float
    j2: float
    j3: float
    j4: float
    j5: float
    j6: float
    j7: float
    j8: float
    j9: float


def judge(desired: Array, measured: Array, reference: Array) -> Criteria:
    """Return the criteria of one test.

    Parameters
    ----------
    desired : ndarray
        Displacements of all floors that the numerical part computed, m, shape (n, 3).
    measured : ndarray
        Measured displacement of the first floor, m, shape (n,).
    reference : ndarray
        Displacements of all floors of the wholly simulated building, m, shape (n, 3).

    Returns
    -------
    Criteria
        J1 to J9.
    """
    first, true = desired[:, 0], reference[:, 0]
    return Criteria(
        1e3 * delay(first, measured),
        _rms(measured - first, first),
        _peak(measured - first, first),
        _rms(measured - true, true),
        _peak(measured - true, true),
        _rms(desired[:, 1] - reference[:, 1], reference[:, 1]),
        _rms(desired[:, 2] - reference[:, 2], reference[:, 2]),
        _peak(desired[:, 1] - reference[:, 1], reference[:, 1]),
        _peak(desired[:, 2] - reference[:, 2], reference[:, 2]),
    )


def delay(commanded: Array, measured: Array) -> float:
    """Return the delay of `measured` behind `commanded`, s, in whole ticks.

    The delay is the shift of the largest cross-correlation.
    """
    most = round(LONGEST / PERIOD)
    # The ends are cut off, so every shift correlates the same number of samples.
    inner = slice(most, len(commanded) - most)
    correlation = correlate(measured, commanded[inner], mode="valid", method="fft")
    return (int(np.argmax(correlation)) - most) * PERIOD


def _rms(error: Array, signal: Array) -> float:
    """Return the rms of an error relative to the rms of a signal, %."""
    # The standard deviation is the rms about the mean, so an offset of a signal does not count.
    return 100.0 * float(np.std(error) / np.std(signal))


def _peak(error: Array, signal: Array) -> float:
    """Return the peak of an error relative to the peak of a signal, %."""
    return 100.0 * float(np.max(np.abs(error)) / np.max(np.abs(signal)))
