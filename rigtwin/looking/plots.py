"""One sensor as measured and as predicted, and what is left between them."""

from __future__ import annotations

import numpy as np
import viser
from viser import uplot

from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.scale import shorten
from rigtwin.looking.traces import mark, thin
from rigtwin.numerics.arrays import Array

WHOLE = "whole test"
STRETCHES = {WHOLE: np.inf, "10 s": 10.0, "2 s": 2.0, "0.5 s": 0.5}
"""What is shown about the time that is looked at, s."""
HEIGHT = 230
"""Pixels of a plot."""
MEASURED, PREDICTED, NOMINAL, NOW = "#1f2933", "#eb6e14", "#9fb3c8", "#c5ced8"


class Plots:
    """Two plots of one sensor, one over the other."""

    def __init__(self, server: viser.ViserServer, look: Look, sensor: str) -> None:
        self._look, self._row, self._stretch = look, -1, WHOLE
        start = np.array([look.time[0], look.time[-1]])
        self._traces = server.gui.add_uplot(
            (start, *[np.zeros(len(start))] * 4),
            (
                uplot.Series(label="time, s"),
                uplot.Series(label="measured", stroke=MEASURED, width=1.2),
                uplot.Series(label="described twin", stroke=NOMINAL, width=1),
                uplot.Series(label="this twin", stroke=PREDICTED, width=1.5),
                uplot.Series(label="now", stroke=NOW, width=1),
            ),
            scales={"x": uplot.Scale(time=False)},
            height=HEIGHT,
        )
        self._residual = server.gui.add_uplot(
            (start, *[np.zeros(len(start))] * 3),
            (
                uplot.Series(label="time, s"),
                uplot.Series(label="described twin", stroke=NOMINAL, width=1),
                uplot.Series(label="this twin", stroke=PREDICTED, width=1.2),
                uplot.Series(label="now", stroke=NOW, width=1),
            ),
            scales={"x": uplot.Scale(time=False)},
            height=HEIGHT,
        )
        self.show(sensor, WHOLE)

    def show(self, sensor: str, stretch: str) -> None:
        """Chooses what `draw` draws: a sensor, and one of `STRETCHES`."""
        look, row = self._look, self._look.sensors.index(sensor)
        self._stretch = stretch
        if row == self._row:
            return
        self._row = row
        left = look.measured[row] - look.nominal.signals[row]
        # A page's axes have three decimals.
        self._factor, unit = shorten(float(np.max(np.abs(look.measured[row]))), look.units[row])
        self._finer, unit_left = shorten(float(np.max(np.abs(left))), look.units[row])
        self._traces.title = _title(sensor, unit)
        self._residual.title = _title("residual: measured less predicted", unit_left)

    def draw(self, prediction: Prediction, now: float) -> None:
        """Draws a twin's prediction with the time `now`, s, marked."""
        look, row = self._look, self._row
        part = _window(look.time, now, STRETCHES[self._stretch])
        measured = look.measured[row][part]
        nominal, predicted = look.nominal.signals[row][part], prediction.signals[row][part]
        time, traces = thin(look.time[part], [measured, nominal, predicted])
        self._traces.data = mark(time, [self._factor * trace for trace in traces], now)
        time, traces = thin(look.time[part], [measured - nominal, measured - predicted])
        self._residual.data = mark(time, [self._finer * trace for trace in traces], now)


def _title(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


def _window(time: Array, now: float, length: float) -> slice:
    """Ticks of a stretch about a time, moved to lie within the test."""
    if length >= time[-1] - time[0]:
        return slice(0, len(time))
    start = min(max(now - 0.5 * length, float(time[0])), float(time[-1]) - length)
    first, last = np.searchsorted(time, [start, start + length])
    return slice(int(first), max(int(last), int(first) + 2))
