"""The pictures of a report, drawn: lines that a reader can zoom, without a network.

Bokeh draws them. Its wheel ships its JavaScript, of which the core alone is bundled into the file
(1.3 MB; Plotly's is 4.8 MB), and it draws on a canvas, which stays quick with ten thousand points.
"""

# Bokeh gives its models' properties the type of the property, not of what is assigned to it.
# pyright: reportArgumentType=false
from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.embed import components
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
from bokeh.resources import Resources
from markupsafe import Markup

from rigtwin.diagnosis.overlay import Overlay
from rigtwin.diagnosis.pictures import Curve, Picture
from rigtwin.diagnosis.units import find_unit, say, spell
from rigtwin.numerics.arrays import Array

MEASURED, BEFORE, AFTER, SAMPLES = "#1e293b", "#c2410c", "#0f766e", "#94a3b8"
COLOURS = {"measured": MEASURED, "before": BEFORE, "after": AFTER, "samples": SAMPLES}
LABELS = {
    "measured": "measured",
    "before": "without it",
    "after": "with it",
    "samples": "single samples",
}
WIDTHS = {"measured": 6.0, "before": 1.8, "after": 1.6}
HEIGHT = 340
"""px."""
LINES = 240_000
"""Points of all overlaid lines of a report together."""
MOST, LEAST = 4000, 600
"""Points of one of them."""
NAMED = re.compile(r'"(p\d{4,}|[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12})"')
"""What Bokeh calls its models, and their places on the page, by chance."""
MARGIN = 0.06
"""Of an axis beyond what is looked at."""


@dataclass(frozen=True)
class Drawn:
    """One figure of the page. markup: where it stands; label: what it is, for a screen reader;
    caption: what to see in it."""

    markup: Markup
    label: str
    caption: str


@dataclass(frozen=True)
class Drawings:
    """All figures of a page and what runs them. library: Bokeh itself; script: their data."""

    evidence: tuple[Drawn, ...]
    overlays: tuple[Drawn, ...]
    library: Markup
    script: Markup


def thin(time: Array, values: Array, points: int) -> tuple[Array, Array]:
    """A line with so few points that its least and greatest value stay wherever one pixel holds
    several.

    Parameters
    ----------
    time, values
        Shape (ticks,).
    points
        At most so many.

    Returns
    -------
    tuple of arrays
        Time and values of at most `points` ticks, in their order.
    """
    if len(values) <= points:
        return time, values
    block = math.ceil(2 * len(values) / points)
    whole = len(values) // block * block
    folded = values[:whole].reshape(-1, block)
    start = np.arange(len(folded)) * block
    kept = np.unique(np.concatenate([start + folded.argmin(axis=1), start + folded.argmax(axis=1)]))
    if whole < len(values):
        kept = np.append(kept, len(values) - 1)
    return time[kept], values[kept]


def _canvas(x: str, y: str, logarithmic: tuple[bool, bool], start: Range1d | None = None) -> figure:
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


def _draw_curve(drawn: figure, curve: Curve, x: Array, y: Array, label: str) -> None:
    source = ColumnDataSource({"x": x.astype(np.float32), "y": y.astype(np.float32)})
    colour = COLOURS[curve.role]
    if curve.points:
        crowd = len(x) > 100
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
        # The measured line is broad and pale, so that it shows under one that lies on it.
        line_width=WIDTHS[curve.role],
        line_alpha=0.4 if curve.role == "measured" else 1.0,
        line_dash="dashed" if curve.role == "before" else "solid",
        legend_label=label,
    )


def _place_legend(drawn: figure) -> None:
    legend = drawn.legend[0]
    drawn.add_layout(legend, "above")
    legend.orientation = "horizontal"
    legend.ncols = 3 if len(drawn.renderers) == 3 else 2
    legend.border_line_color = None
    legend.label_text_font_size = "12px"
    legend.padding, legend.spacing, legend.margin = 2, 12, 2
    legend.click_policy = "hide"


def draw_picture(picture: Picture) -> figure:
    """An effect in the data."""
    x_all = np.concatenate([curve.x for curve in picture.curves])
    y_all = np.concatenate([curve.y for curve in picture.curves])
    x_factor, x_unit = find_unit(picture.x_unit, float(np.max(np.abs(x_all), initial=0.0)))
    y_factor, y_unit = find_unit(picture.y_unit, float(np.max(np.abs(y_all), initial=0.0)))
    drawn = _canvas(_label(picture.x, x_unit), _label(picture.y, y_unit), picture.logarithmic, None)
    for curve in picture.curves:
        _draw_curve(drawn, curve, x_factor * curve.x, y_factor * curve.y, LABELS[curve.role])
    _place_legend(drawn)
    return drawn


def _label(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


def draw_overlay(overlay: Overlay, points: int, corrected: bool) -> figure:
    """A sensor as measured and as predicted, its worst second in view."""
    signals = {"measured": overlay.measured, "before": overlay.nominal}
    if corrected:
        signals["after"] = overlay.corrected
    labels = {"measured": "measured", "before": "nominal", "after": "corrected"}
    start, end = overlay.worst
    first, last = float(overlay.time[0]), float(overlay.time[-1])
    largest = max(float(np.max(np.abs(values))) for values in signals.values())
    factor, unit = find_unit(overlay.unit, largest)
    drawn = _canvas(
        "time, s",
        _label(overlay.sensor.replace("_", " "), unit),
        (False, False),
        Range1d(start, end, bounds=(first, last)),
    )
    seen = (overlay.time >= start) & (overlay.time <= end)
    shown = np.concatenate([factor * values[seen] for values in signals.values()])
    low, high = float(shown.min()), float(shown.max())
    margin = MARGIN * (high - low) or 1.0
    drawn.y_range = Range1d(low - margin, high + margin)
    for role, values in signals.items():
        time, thinned = _thin_beside(overlay.time, values, seen, points)
        _draw_curve(drawn, Curve(role, time, thinned), time, factor * thinned, labels[role])
    _place_legend(drawn)
    return drawn


def _thin_beside(time: Array, values: Array, seen: Array, points: int) -> tuple[Array, Array]:
    """The stretch in view with half of the points, the rest with the others."""
    first, last = int(np.argmax(seen)), len(seen) - int(np.argmax(seen[::-1]))
    parts = [
        thin(time[part], values[part], count)
        for part, count in (
            (slice(0, first), points // 4),
            (slice(first, last), points // 2),
            (slice(last, None), points // 4),
        )
    ]
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def _caption(overlay: Overlay, corrected: bool) -> str:
    start, end = overlay.worst
    name = overlay.sensor.replace("_", " ")
    where = f"{'held-out ' if overlay.held_out else ''}{overlay.recording}"
    text = (
        f"The {name} of {where}, {start:.2f} to {end:.2f} s, where the "
        f"{'corrected' if corrected else 'nominal'} prediction is worst. "
        f"The nominal one is off by {say(overlay.before, overlay.unit)} rms "
        f"({spell(overlay.before_percent, 2)} % of the signal) over the whole recording"
    )
    if corrected:
        text += (
            f", the corrected one by {say(overlay.after, overlay.unit)} "
            f"({spell(overlay.after_percent, 2)} %)"
        )
    return f"{text}."


def _name_steadily(script: str, places: Sequence[str]) -> list[str]:
    """The script and its places with names that are the same whenever the same is drawn, and
    others for another page, since a notebook may show several."""
    texts = [script, *places]
    names = list(dict.fromkeys(name for text in texts for name in NAMED.findall(text)))
    numbers = {name: number for number, name in enumerate(names)}
    bare = [NAMED.sub(lambda found: f'"{numbers[found[1]]}"', text) for text in texts]
    page = hashlib.sha256("".join(bare).encode()).hexdigest()[:8]
    return [NAMED.sub(lambda found: f'"{page}-{numbers[found[1]]}"', text) for text in texts]


def draw(pictures: Sequence[Picture], overlays: Sequence[Overlay], corrected: bool) -> Drawings:
    """Draws all figures of a report.

    Parameters
    ----------
    pictures
        One for each finding.
    overlays
        The sensors.
    corrected
        Whether there is a corrected prediction beside the nominal one.

    Returns
    -------
    Drawings
        Ready for the page.
    """
    lines = (3 if corrected else 2) * max(len(overlays), 1)
    points = min(max(LINES // lines, LEAST), MOST)
    captions = [picture.caption for picture in pictures]
    captions += [_caption(overlay, corrected) for overlay in overlays]
    labels = [f"{p.effect}: {p.y} against {p.x}" for p in pictures]
    labels += [
        f"{o.sensor.replace('_', ' ')} over time in {o.recording}, measured and predicted"
        for o in overlays
    ]
    models = [
        *(draw_picture(picture) for picture in pictures),
        *(draw_overlay(overlay, points, corrected) for overlay in overlays),
    ]
    if not models:
        return Drawings((), (), Markup(), Markup())
    script, *places = _name_steadily(*components(tuple(models)))
    drawn = [
        Drawn(Markup(place), label, caption)
        for place, label, caption in zip(places, labels, captions, strict=True)
    ]
    return Drawings(
        tuple(drawn[: len(pictures)]),
        tuple(drawn[len(pictures) :]),
        Markup(Resources(mode="inline", components=["bokeh"]).render_js()),
        Markup(script),
    )
