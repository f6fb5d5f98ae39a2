"""What a twin with effects of given values predicts of a recording, and how far off it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.evidence import Lines
from rigtwin.diagnosis.overlay import COUNTS
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Prediction:
    """One twin's prediction of one recording.

    signals: each sensor's, in its unit, shape (sensors, ticks); percent: by sensor, the rms of
    measured less predicted in percent of the measured signal's standard deviation, or of its noise
    where that is larger; overall: the rms of these.
    """

    signals: Array
    percent: dict[str, float]

    @property
    def overall(self) -> float:
        """Percent."""
        return math.sqrt(sum(each**2 for each in self.percent.values()) / len(self.percent))


def judge(sensors: Sequence[str], lines: Lines, signals: Array) -> Prediction:
    """A prediction with its errors.

    Parameters
    ----------
    sensors
        Names, in the order of the rows.
    lines
        The recording as the model predicts it.
    signals
        Predicted, shape (sensors, ticks).

    Returns
    -------
    Prediction
        Errors are of the ticks that count, as in a diagnosis' report.
    """
    percent = {}
    for row, sensor in enumerate(sensors):
        counts = lines.fade[row] > COUNTS
        measured = lines.measured[row][counts]
        left = measured - signals[row][counts]
        swing = max(float(np.std(measured)) if len(measured) else 0.0, float(lines.noise[row]))
        rms = float(np.sqrt(np.mean(left**2))) if len(left) else 0.0
        percent[sensor] = 100.0 * rms / swing
    return Prediction(signals, percent)
