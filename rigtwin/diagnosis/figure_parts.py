"""Parts that the figures of a report share."""

# Bokeh declares a property with the property's type, not with that of the assigned value.
# pyright: reportArgumentType=false
from __future__ import annotations

import math

import numpy as np
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure

from rigtwin.diagnosis.picture import PictureCurve
from rigtwin.numerics.arrays import Array

MEASURED, BEFORE, AFTER, SAMPLES = "#1e293b", "#c2410c", "#0f766e", "#94a3b8"
COLOURS = {"measured": MEASURED, "before": BEFORE, "after": AFTER, "samples": SAMPLES}
LABELS = {
    "measured": "measured",
    "before": "without the effect",
    "after": "with the effect",
    "samples": "single samples",
}
WIDTHS = {"measured": 6.0, "before": 1.8, "after": 1.6}
HEIGHT = 340
"""Height of a figure, px."""
CROWD = 100
"""Points from which a cloud is drawn with small, translucent dots."""


def thin(time: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Thin a line so that its extremes remain.

    Every block of ticks keeps its smallest and its largest value. A pixel that holds a block then
    shows the same stroke as with all ticks, so peaks stay visible.

    Parameters
    ----------
    time, values
        Coordinates, shape (ticks,).
    points
        Largest number of points of the result, plus one for an incomplete last block.

    Returns
    -------
    tuple of arrays
        Time and values of the remaining ticks, in their order.
    """
    if len(values) <= points:
        return time, values
    # Two values of each block remain, hence the factor 2.
    block = math.ceil(2 * len(values) / points)
    whole = len(values) // block * block
    folded = values[:whole].reshape(-1, block)
    start = np.arange(len(folded)) * block
    # `unique` also sorts, as the minimum of a block may come after its maximum.
    remaining = np.unique(
        np.concatenate([start + folded.argmin(axis=1), start + folded.argmax(axis=1)])
    )
    # The line must reach the end of the recording also where the last block is incomplete.
    if whole < len(values):
        remaining = np.append(remaining, len(values) - 1)
    return time[remaining], values[remaining]


def make_figure(
    x: str, y: str, logarithmic: tuple[bool, bool], start: Range1d | None = None
) -> figure:
    """Return an empty figure of the report."""
    ranges = {} if start is None else {"x_range": start}
    drawn = figure(
        height=HEIGHT,
        sizing_mode="stretch_width",
        x_axis_label=x,
        y_axis_label=y,
        x_axis_type="log" if logarithmic[0] else "linear",
        y_axis_type="log" if logarithmic[1] else "linear",
        tools="box_zoom,xwheel_zoom,pan,reset,save",
        active_drag="box_zoom",
        active_scroll=None,
        min_width=260,
        **ranges,
    )
    drawn.toolbar.logo = None
    drawn.toolbar.autohide = True
    drawn.outline_line_color = None
    for axis in drawn.axis:
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = "13px"
        axis.major_label_text_font_size = "12px"
        axis.axis_label_text_color = axis.major_label_text_color = "#334155"
        axis.axis_line_color = "#94a3b8"
        axis.minor_tick_line_color = None
    for grid in drawn.grid:
        grid.grid_line_color = "#e2e8f0"
    return drawn


def draw_curve(drawn: figure, curve: PictureCurve, x: Array, y: Array, label: str) -> None:
    """Draw a curve of a picture as a line or as a cloud of points."""
    # Single precision halves the file; no screen has more digits.
    source = ColumnDataSource({"x": x.astype(np.float32), "y": y.astype(np.float32)})
    colour = COLOURS[curve.role]
    if curve.points:
        crowd = len(x) > CROWD
        drawn.scatter(
            "x",
            "y",
            source=source,
            size=3 if crowd else 8,
            color=colour,
            alpha=0.45 if crowd else 1.0,
            line_color=None,
            legend_label=label,
        )
        return
    drawn.line(
        "x",
        "y",
        source=source,
        color=colour,
        # The measured line is broad and pale, so that it stays visible under a prediction.
        line_width=WIDTHS[curve.role],
        line_alpha=0.4 if curve.role == "measured" else 1.0,
        line_dash="dashed" if curve.role == "before" else "solid",
        legend_label=label,
    )


def place_legend(drawn: figure) -> None:
    """Place the legend beside the curves; a click on an entry hides its curve."""
    legend = drawn.legend[0]
    drawn.add_layout(legend, "above")
    legend.orientation = "horizontal"
    legend.ncols = 3 if len(drawn.renderers) == 3 else 2
    legend.border_line_color = None
    legend.label_text_font_size = "12px"
    legend.padding, legend.spacing, legend.margin = 2, 12, 2
    legend.click_policy = "hide"


def axis_label(name: str, unit: str) -> str:
    """Return the label of an axis: a name with its unit."""
    return f"{name}, {unit}" if unit else name
