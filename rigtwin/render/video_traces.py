"""Traces beneath the picture of a video."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rigtwin.numerics.arrays import Array
from rigtwin.render.curves import Curve

Image = NDArray[np.uint8]
WIDTH, SCENE_HEIGHT, TRACE_HEIGHT = 960, 432, 288


class Traces:
    """Plots below the scene. They are drawn once; each frame adds only the time mark."""

    def __init__(self, curves: Sequence[Curve], time: Array, ticks: slice) -> None:
        time = time[ticks]
        figure = Figure(figsize=(WIDTH / 100, TRACE_HEIGHT / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        # Two axes fit below the scene; a machine with more channels shows the first ones.
        titles = list(dict.fromkeys(curve.axis for curve in curves))[:2]
        axes = figure.subplots(max(len(titles), 1), 1, sharex=True, squeeze=False)[:, 0]
        for axis, title in zip(axes, titles, strict=False):
            for curve in (line for line in curves if line.axis == title):
                axis.plot(
                    time, curve.values[ticks], color=curve.colour, linewidth=0.9, label=curve.label
                )
            axis.set_ylabel(title, fontsize=8)
            if len(axis.lines) > 1:
                axis.legend(
                    loc="upper right", fontsize=7, framealpha=0.85, edgecolor="none", ncols=2
                )
        upper, lower = axes[0], axes[-1]
        lower.set_xlabel("time, s", fontsize=8)
        for axis in axes:
            axis.grid(alpha=0.3)
            axis.tick_params(labelsize=7)
            axis.set_xlim(time[0], time[-1])
        figure.subplots_adjust(left=0.07, right=0.985, top=0.97, bottom=0.16, hspace=0.12)
        canvas.draw()
        self._picture: Image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        box = lower.get_window_extent()
        # Pixel rows count from the top in a picture, but from the bottom in matplotlib.
        top = upper.get_window_extent()
        self._rows = slice(TRACE_HEIGHT - int(top.y1), TRACE_HEIGHT - int(box.y0))
        self._left, self._width = box.x0, box.width
        self._start, self._span = float(time[0]), float(time[-1] - time[0])

    def at(self, time: float) -> Image:
        """Return the plots with the mark at a time in s."""
        picture = self._picture.copy()
        # The mark is two pixels wide, drawn into a copy of the finished picture.
        column = int(self._left + self._width * (time - self._start) / self._span)
        picture[self._rows, max(column - 1, 0) : column + 1] = (20, 20, 20)
        return picture
