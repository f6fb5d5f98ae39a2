"""Drawings of root loci beside their ideal poles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.thesis.loci import LocusCase, LocusFigure
from experiments.thesis.study import Drawing, sheet
from rigtwin.studies.stability.locus import Locus


def drawing(name: str, covers: str, caption: str, cases: Sequence[LocusCase]) -> Drawing:
    """Return a drawing with all panels of some cases."""
    panels = [(case, panel) for case in cases for panel in case.panels]
    # Two or four panels fill a sheet of two columns; otherwise three leave least space empty.
    columns = 2 if len(panels) in (2, 4) else 3
    figure, axes = sheet(math.ceil(len(panels) / columns), columns, width=4.0 * columns, height=3.6)
    flat = [axis for row in axes for axis in row]
    for axis, (case, panel) in zip(flat, panels, strict=False):
        _draw(axis, case, panel)
    for axis in flat[len(panels) :]:
        axis.set_visible(False)
    _legend(figure, flat[0])
    return Drawing(name, covers, caption, figure)


def _draw(axis: Axes, case: LocusCase, panel: LocusFigure) -> None:
    """Draw one panel of a case."""
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.axvline(0.0, color="0.3", linewidth=0.8, zorder=0)
    _draw_ideal_poles(axis, case.locus)
    _draw_poles(axis, case.locus)
    if panel.view is not None:
        lowest, highest, height = panel.view
        axis.set_xlim(lowest, highest)
        axis.set_ylim(-height, height)
    axis.set_title(f"Figure {panel.name}: {case.title}", fontsize=8)
    _annotate(axis, case)
    axis.set_xlabel("real part, 1/s", fontsize=8)
    axis.set_ylabel("imaginary part, rad/s", fontsize=8)


def _draw_ideal_poles(axis: Axes, locus: Locus) -> None:
    """Draw the poles of the ideal system, grey."""
    ideal = locus.ideal
    # A sweep of the lag does not move the ideal poles: they are drawn as single points.
    if np.allclose(ideal, ideal[0]):
        axis.plot(
            ideal[0].real, ideal[0].imag, "+", color="0.35", markersize=10, label="ideal", zorder=5
        )
        return
    axis.plot(
        ideal.real.ravel(),
        ideal.imag.ravel(),
        ".",
        color="0.65",
        markersize=4,
        label="ideal",
        zorder=1,
    )


def _draw_poles(axis: Axes, locus: Locus) -> None:
    """Draw the poles along the sweep, its ends, and the crossings of the imaginary axis."""
    # Dark at the start, light at the end; vmax leaves out the palest colours of the map.
    colours = np.repeat(np.linspace(0.0, 1.0, len(locus.values)), locus.poles.shape[1])
    axis.scatter(
        locus.poles.real.ravel(),
        locus.poles.imag.ravel(),
        s=2.0,
        c=colours,
        cmap="viridis",
        vmax=1.1,
        label="MIL",
        zorder=2,
    )
    for row, marker, label in ((0, "o", "start of the sweep"), (-1, "s", "its end")):
        axis.plot(
            locus.poles[row].real,
            locus.poles[row].imag,
            marker,
            color="black",
            markerfacecolor="none",
            markersize=5,
            linestyle="none",
            label=label,
            zorder=3,
        )
    # Poles come in conjugate pairs, so both crossings of a pair are marked.
    heights = [sign * crossing.frequency for crossing in locus.crossings for sign in (1.0, -1.0)]
    axis.plot(
        [0.0] * len(heights),
        heights,
        "x",
        color="#d62728",
        markersize=7,
        label="crossing",
        zorder=4,
    )


def _annotate(axis: Axes, case: LocusCase) -> None:
    """Write the range of the sweep and the values of the crossings into a panel."""
    variation = case.variation
    values = ", ".join(dict.fromkeys(f"{crossing.value:.4g}" for crossing in case.locus.crossings))
    sweep = f"{variation.symbol} {variation.start:g} to {variation.end:g} {variation.unit}"
    crossing = f"\ncrossing at {values}" if values else "\nno crossing"
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5}
    axis.text(
        0.02,
        0.98,
        sweep + crossing,
        transform=axis.transAxes,
        fontsize=7,
        va="top",
        zorder=6,
        bbox=box,
    )


def _legend(figure: Figure, axis: Axes) -> None:
    """Draw one legend for all panels below the figure."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(labels),
        fontsize=8,
        frameon=False,
        markerscale=1.5,
    )
