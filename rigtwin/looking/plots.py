"""One sensor as measured and as predicted, and what is left between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from viser import uplot

from rigtwin.looking.scale import shorten
from rigtwin.looking.traces import mark, thin
from rigtwin.numerics.arrays import Array

HEIGHT = 230
"""Pixels of a plot."""
MEASURED, NOW = "#1f2933", "#c5ced8"
TWIN, DESCRIBED = "#eb6e14", "#9fb3c8"
"""Colours of what twins predict."""
TIME = uplot.Series(label="time, s")
UPRIGHT = uplot.Series(label="now", stroke=NOW, width=1)


class Plots:
    """Two plots of one sensor, one over the other."""

    def __init__(
        self, server: viser.ViserServer, twins: Mapping[str, str], start: float, end: float
    ) -> None:
        """twins: what predicts → its colour; start, end: s, what is drawn first, of which a page
        keeps showing the share that it then showed."""
        nothing, count = np.zeros(2), len(twins)
        predicted = [
            uplot.Series(label=twin, stroke=colour, width=1.2) for twin, colour in twins.items()
        ]
        measured = uplot.Series(label="measured", stroke=MEASURED, width=1.2)
        scales = {"x": uplot.Scale(time=False)}
        time = np.array([start, end])
        self._traces = server.gui.add_uplot(
            (time, *[nothing] * (count + 2)),
            (TIME, measured, *predicted, UPRIGHT),
            scales=scales,
            height=HEIGHT,
        )
        self._residual = server.gui.add_uplot(
            (time, *[nothing] * (count + 1)),
            (TIME, *predicted, UPRIGHT),
            scales=scales,
            height=HEIGHT,
        )
        self._factor = self._finer = 1.0

    def name(self, sensor: str, unit: str, largest: float, largest_left: float) -> None:
        """Says what is drawn from now on.

        Parameters
        ----------
        sensor, unit
            As described.
        largest, largest_left
            Of its values and of what is left of them, in `unit`: a page's axes have three decimals.
        """
        self._factor, shown = shorten(largest, unit)
        self._finer, shown_left = shorten(largest_left, unit)
        titles = _title(sensor, shown), _title("residual: measured less predicted", shown_left)
        for plot, title in zip((self._traces, self._residual), titles, strict=True):
            if plot.title != title:
                plot.title = title

    def draw(self, time: Array, measured: Array, predicted: Sequence[Array], now: float) -> None:
        """Draws a stretch.

        Parameters
        ----------
        time
            s, shape (ticks,).
        measured
            Of the sensor, shape (ticks,).
        predicted
            By each twin, shape (ticks,).
        now
            s, a time that is marked.
        """
        times, traces = thin(time, [measured, *predicted])
        self._traces.data = mark(times, [self._factor * trace for trace in traces], now)
        times, traces = thin(time, [measured - each for each in predicted])
        self._residual.data = mark(times, [self._finer * trace for trace in traces], now)


def _title(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name
