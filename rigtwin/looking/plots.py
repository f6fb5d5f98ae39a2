"""Plots of one sensor as measured and as predicted, and of the residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from viser import uplot

from rigtwin.looking.scale import shorten
from rigtwin.looking.traces import mark, thin
from rigtwin.numerics.arrays import Array

HEIGHT = 230
"""Height of a plot in pixels."""
MEASURED, NOW = "#1f2933", "#c5ced8"
TWIN, DESCRIBED = "#eb6e14", "#9fb3c8"
"""Colours of the twins' predictions."""
TIME = uplot.Series(label="time, s")
UPRIGHT = uplot.Series(label="now", stroke=NOW, width=1)


class Plots:
    """Two plots of one sensor, one above the other."""

    def __init__(
        self, server: viser.ViserServer, twins: Mapping[str, str], start: float, end: float
    ) -> None:
        """Build the plots.

        Parameters
        ----------
        server
            Server of the page.
        twins
            Name of each twin → its colour.
        start, end
            Stretch drawn first, in s. The browser keeps its zoom relative to this stretch.
        """
        empty, count = np.zeros(2), len(twins)
        predicted = [
            uplot.Series(label=twin, stroke=colour, width=1.2) for twin, colour in twins.items()
        ]
        measured = uplot.Series(label="measured", stroke=MEASURED, width=1.2)
        # uPlot takes x for seconds since 1970 unless told otherwise.
        scales = {"x": uplot.Scale(time=False)}
        time = np.array([start, end])
        self._traces = server.gui.add_uplot(
            (time, *[empty] * (count + 2)),
            (TIME, measured, *predicted, UPRIGHT),
            scales=scales,
            height=HEIGHT,
        )
        self._residual = server.gui.add_uplot(
            (time, *[empty] * (count + 1)),
            (TIME, *predicted, UPRIGHT),
            scales=scales,
            height=HEIGHT,
        )
        self._factor = self._finer = 1.0

    def name(self, sensor: str, unit: str, largest: float, largest_residual: float) -> None:
        """Set the titles and the units of the axes.

        Parameters
        ----------
        sensor, unit
            Name and unit of the sensor.
        largest, largest_residual
            Largest magnitudes of the signal and of its residual, in `unit`. They determine the
            shown unit, because a page's axes have only three decimals.
        """
        self._factor, shown = shorten(largest, unit)
        self._finer, shown_residual = shorten(largest_residual, unit)
        titles = _title(sensor, shown), _title("residual: measured less predicted", shown_residual)
        for plot, title in zip((self._traces, self._residual), titles, strict=True):
            # Every assignment is sent to the browsers, so only changes are made.
            if plot.title != title:
                plot.title = title

    def draw(self, time: Array, measured: Array, predicted: Sequence[Array], now: float) -> None:
        """Draw a stretch.

        Parameters
        ----------
        time
            Times in s, shape (ticks,).
        measured
            Measured signal, shape (ticks,).
        predicted
            Prediction of each twin, shape (ticks,).
        now
            Time that is marked, in s.
        """
        times, traces = thin(time, [measured, *predicted])
        self._traces.data = mark(times, [self._factor * trace for trace in traces], now)
        times, traces = thin(time, [measured - prediction for prediction in predicted])
        self._residual.data = mark(times, [self._finer * trace for trace in traces], now)


def _title(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name
