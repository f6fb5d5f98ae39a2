"""Figures of a report: lines that a reader can zoom without a network.

Bokeh draws them. Its wheel ships its JavaScript, of which the core alone is bundled into the file
(1.3 MB; Plotly's is 4.8 MB). It draws on a canvas, which stays quick with ten thousand points.
"""

# Bokeh declares a property with the property's type, not with that of the assigned value.
# pyright: reportArgumentType=false
from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.embed import components
from bokeh.models import Range1d
from bokeh.plotting import figure
from bokeh.resources import Resources
from markupsafe import Markup

from rigtwin.diagnosis.figure_parts import (
    LABELS,
    axis_label,
    draw_curve,
    make_figure,
    place_legend,
    thin,
)
from rigtwin.diagnosis.overlay import Overlay
from rigtwin.diagnosis.picture import Picture, PictureCurve
from rigtwin.diagnosis.units import find_unit, spell
from rigtwin.numerics.arrays import Array

ALL_POINTS = 240_000
"""Points of all overlaid lines of a report together."""
MOST, LEAST = 4000, 600
"""Largest and smallest number of points of one overlaid line."""
IDENTIFIER = re.compile(r'"(p\d{4,}|[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12})"')
"""Identifiers that Bokeh draws at random for its models and their places on the page."""
MARGIN = 0.06
"""Margin of an axis beyond the values in view, as a share of their range."""


@dataclass(frozen=True)
class Drawn:
    """One figure of the page.

    Attributes
    ----------
    markup
        Element that the script fills.
    label
        Description for a screen reader.
    caption
        Sentences that tell what to see in the figure.
    """

    markup: Markup
    label: str
    caption: str


@dataclass(frozen=True)
class Drawings:
    """All figures of a page.

    Attributes
    ----------
    evidence
        Pictures of the effects.
    overlays
        Sensors over time.
    library
        JavaScript of Bokeh.
    script
        Data of the figures.
    """

    evidence: tuple[Drawn, ...]
    overlays: tuple[Drawn, ...]
    library: Markup
    script: Markup


def draw_picture(picture: Picture) -> figure:
    """Draw an effect in the data.

    Parameters
    ----------
    picture
        Numbers of the picture.

    Returns
    -------
    figure
        Bokeh figure with axes in engineering units.
    """
    x_all = np.concatenate([curve.x for curve in picture.curves])
    y_all = np.concatenate([curve.y for curve in picture.curves])
    x_factor, x_unit = find_unit(picture.x_unit, float(np.max(np.abs(x_all), initial=0.0)))
    y_factor, y_unit = find_unit(picture.y_unit, float(np.max(np.abs(y_all), initial=0.0)))
    drawn = make_figure(
        axis_label(picture.x, x_unit), axis_label(picture.y, y_unit), picture.logarithmic, None
    )
    for curve in picture.curves:
        draw_curve(drawn, curve, x_factor * curve.x, y_factor * curve.y, LABELS[curve.role])
    place_legend(drawn)
    return drawn


def draw_overlay(overlay: Overlay, points: int, corrected: bool) -> figure:
    """Draw a sensor as measured and as predicted.

    Parameters
    ----------
    overlay
        Signals of the sensor.
    points
        Largest number of points of a line.
    corrected
        Whether the corrected prediction is drawn too.

    Returns
    -------
    figure
        Bokeh figure with the second of the largest error in view.
    """
    signals = {"measured": overlay.measured, "before": overlay.nominal}
    if corrected:
        signals["after"] = overlay.corrected
    labels = {"measured": "measured", "before": "nominal", "after": "corrected"}
    start, end = overlay.worst
    first, last = float(overlay.time[0]), float(overlay.time[-1])
    largest = max(float(np.max(np.abs(values))) for values in signals.values())
    factor, unit = find_unit(overlay.unit, largest)
    drawn = make_figure(
        "time, s",
        axis_label(overlay.sensor.replace("_", " "), unit),
        (False, False),
        Range1d(start, end, bounds=(first, last)),
    )
    in_view = (overlay.time >= start) & (overlay.time <= end)
    shown = np.concatenate([factor * values[in_view] for values in signals.values()])
    low, high = float(shown.min()), float(shown.max())
    # A constant signal would have an axis without height.
    margin = MARGIN * (high - low) or 1.0
    drawn.y_range = Range1d(low - margin, high + margin)
    for role, values in signals.items():
        time, thinned = _thin_outside(overlay.time, values, in_view, points)
        draw_curve(drawn, PictureCurve(role, time, thinned), time, factor * thinned, labels[role])
    place_legend(drawn)
    return drawn


def _thin_outside(time: Array, values: Array, in_view: Array, points: int) -> tuple[Array, Array]:
    """Thin a line, with half of the points for the stretch in view."""
    # `argmax` of a mask is its first true place; reversed, it counts the ticks after the view.
    first, last = int(np.argmax(in_view)), len(in_view) - int(np.argmax(in_view[::-1]))
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
    # One unit for both errors, so that they can be compared at a glance.
    factor, unit = find_unit(overlay.unit, max(overlay.before, overlay.after))
    name = overlay.sensor.replace("_", " ")
    where = f"{'held-out ' if overlay.held_out else ''}{overlay.recording}"
    text = (
        f"The {name} of {where}, {start:.2f} to {end:.2f} s, where the "
        f"{'corrected' if corrected else 'nominal'} prediction has its largest error. "
        "Rms error over the whole recording: "
        f"{spell(factor * overlay.before, 3)} {unit} ({spell(overlay.before_percent, 2)} % of the "
        "signal) nominal"
    )
    if corrected:
        text += (
            f", {spell(factor * overlay.after, 3)} {unit} "
            f"({spell(overlay.after_percent, 2)} %) corrected"
        )
    return f"{text}."


def _name_reproducibly(script: str, places: Sequence[str]) -> list[str]:
    """Replace Bokeh's random identifiers by ones that follow from the content.

    The same diagnosis then gives the same file. The identifiers hold a digest of the page, because
    a notebook may show several pages and they must not clash.
    """
    texts = [script, *places]
    names = list(dict.fromkeys(name for text in texts for name in IDENTIFIER.findall(text)))
    numbers = {name: number for number, name in enumerate(names)}
    # The digest must be one of the content alone, so the random identifiers are numbered before it
    # is taken.
    bare = [IDENTIFIER.sub(lambda match: f'"{numbers[match[1]]}"', text) for text in texts]
    page = hashlib.sha256("".join(bare).encode()).hexdigest()[:8]
    return [IDENTIFIER.sub(lambda match: f'"{page}-{numbers[match[1]]}"', text) for text in texts]


def draw(pictures: Sequence[Picture], overlays: Sequence[Overlay], corrected: bool) -> Drawings:
    """Draw all figures of a report.

    Parameters
    ----------
    pictures
        One picture for each finding.
    overlays
        Overlays of all sensors and recordings.
    corrected
        Whether there is a corrected prediction beside the nominal one.

    Returns
    -------
    Drawings
        Markup and scripts for the page. Empty without pictures and overlays.
    """
    lines = (3 if corrected else 2) * max(len(overlays), 1)
    # The points of all lines together decide on the size of the file.
    points = min(max(ALL_POINTS // lines, LEAST), MOST)
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
    script, *places = _name_reproducibly(*components(tuple(models)))
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
