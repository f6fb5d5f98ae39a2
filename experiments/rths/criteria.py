"""The benchmark's nine criteria."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import correlate

from experiments.rths.building import PERIOD
from rigtwin.numerics.arrays import Array

LONGEST = 0.1
"""s, of the delays that are looked at."""


class Criteria(NamedTuple):
    """J1 in ms, the others in %."""

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
    """The criteria of one test.

    Parameters
    ----------
    desired
        Of all floors, m, shape (n, 3), as the numerical part gives them.
    measured
        Of the first floor, m, shape (n,).
    reference
        Of all floors of the whole building, m, shape (n, 3).
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
    """s by which measured comes later, in whole ticks: where the two correlate most."""
    most = round(LONGEST / PERIOD)
    inner = slice(most, len(commanded) - most)
    at = correlate(measured, commanded[inner], mode="valid", method="fft")
    return (int(np.argmax(at)) - most) * PERIOD


def _rms(error: Array, of: Array) -> float:
    return 100.0 * float(np.std(error) / np.std(of))


def _peak(error: Array, of: Array) -> float:
    return 100.0 * float(np.max(np.abs(error)) / np.max(np.abs(of)))
