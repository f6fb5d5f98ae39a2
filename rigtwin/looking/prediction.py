"""A twin's prediction of a recording, and its errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.lines import Lines
from rigtwin.diagnosis.overlay import COUNTS
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Prediction:
    """Prediction of one recording by one twin.

    Attributes
    ----------
    signals
        Predicted signals in their units, shape (sensors, ticks).
    percent
        RMS residual of each sensor, in percent of the measured signal's standard deviation, or of
        its noise if that is larger.
    """

    signals: Array
    percent: dict[str, float]

    @property
    def overall(self) -> float:
        """RMS of all sensors' errors, in percent."""
        return math.sqrt(sum(error**2 for error in self.percent.values()) / len(self.percent))


def judge(sensors: Sequence[str], lines: Lines, signals: Array) -> Prediction:
    """Return a prediction with its errors.

    Parameters
    ----------
    sensors
        Names of the sensors, in the order of the rows.
    lines
        Recording in the form in which the model predicts it.
    signals
        Predicted signals, shape (sensors, ticks).

    Returns
    -------
    Prediction
        Prediction with errors over the ticks that count, as in a diagnosis' report.
    """
    percent = {}
    for row, sensor in enumerate(sensors):
        # The band filter fades at both ends of the recording; those ticks do not count.
        counts = lines.fade[row] > COUNTS
        measured = lines.measured[row][counts]
        residual = measured - signals[row][counts]
        # A signal that hardly moves is compared with its noise, not with its tiny swing.
        swing = max(float(np.std(measured)) if len(measured) else 0.0, float(lines.noise[row]))
        rms = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
        percent[sensor] = 100.0 * rms / swing
    return Prediction(signals, percent)
