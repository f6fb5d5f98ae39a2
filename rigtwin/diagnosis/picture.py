"""Picture of an effect in the data, and the view of one sensor that it is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.scales import Motion
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.overlay import COUNTS, LOOKED_AT
from rigtwin.diagnosis.words import name_part
from rigtwin.numerics.arrays import Array

AGREES = 0.1
"""Relative difference between the fitted size of an effect and that of the nominal one below which
they agree."""
CYCLE_FACTOR = 2.2
"""Length of a drawn loop in half strokes: one stroke to and fro, and a little more."""
LONGEST_CYCLE = 10.0
"""Longest loop that is drawn, s."""


@dataclass(frozen=True)
class PictureCurve:
    """One line or cloud of points of a picture.

    Attributes
    ----------
    role
        "measured", "before", "after" or "samples".
    x, y
        Coordinates in the picture's units, shape (points,).
    points
        True for a cloud of points, False for a line.
    """

    role: str
    x: Array
    y: Array
    points: bool = False


@dataclass(frozen=True)
class Picture:
    """An effect in the data.

    Attributes
    ----------
    effect
        Name of the effect, `kind@component`.
    form
        Form of the picture, a key of `FORMS`.
    recording, sensor
        Recording and sensor that it shows.
    x, x_unit, y, y_unit
        Labels and SI units of the axes.
    curves
        Lines and clouds.
    logarithmic
        Whether the x axis and the y axis are logarithmic.
    caption
        Sentences that tell what to see in it.
    """

    effect: str
    form: str
    recording: str
    sensor: str
    x: str
    x_unit: str
    y: str
    y_unit: str
    curves: tuple[PictureCurve, ...]
    logarithmic: tuple[bool, bool]
    caption: str


@dataclass(frozen=True)
class View:
    """Data of a picture: one sensor of one recording, with and without an effect.

    Attributes
    ----------
    effect
        Effect that is shown.
    recording, sensor, kind, unit
        Name of the recording, name and kind of the sensor, and the SI unit of its signal.
    angular
        Whether the effect's component turns.
    time
        Time, s, shape (ticks,).
    raw
        Signal as recorded, with its mains hum, in `unit`, shape (ticks,).
    measured, before, after
        Signal, and predictions without and with the effect, in `unit`, shape (ticks,).
    motion
        Motion of the effect's component.
    counts
        Weight of each tick, 0 to 1, shape (ticks,).
    period
        Duration of a tick, s.
    """

    effect: Finding
    recording: str
    sensor: str
    kind: str
    unit: str
    angular: bool
    time: Array
    raw: Array
    measured: Array
    before: Array
    after: Array
    motion: Motion
    counts: Array
    period: float

    @property
    def part(self) -> str:
        """Component of the effect in words."""
        return name_part(self.effect.name.component)

    @property
    def sensor_name(self) -> str:
        """Sensor in words."""
        return name_part(self.sensor)

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Ticks that count, shape (ticks,)."""
        return self.counts > COUNTS


def compare_size(view: View) -> str:
    """Sentence on the size of the effect in this recording, relative to the fitted one.

    It is the slope of a regression of the residual on the effect's own response d,
    dᵀ(measured - before) / dᵀd; 1 if the recording agrees with the fit.
    """
    response = (view.after - view.before)[view.counted]
    # The regression has no constant: an effect without response says nothing about an offset.
    power = float(response @ response)
    if power <= 0.0:
        return ""
    ratio = float(response @ (view.measured - view.before)[view.counted]) / power
    if abs(ratio - 1.0) < AGREES:
        return f" In {view.recording} the effect has the fitted size."
    return f" In {view.recording} the effect has {ratio:.2f} times the fitted size."


def stretch(view: View, weight: Array, seconds: float) -> slice:
    """Ticks of the stretch of that length with the largest sum of a weight, shape (ticks,)."""
    ticks = min(max(round(seconds / view.period), 2), len(view.time))
    # Differences of the cumulative sum are the sums over all windows of that length.
    sums = np.concatenate([[0.0], np.cumsum(weight)])
    start = int(np.argmax(sums[ticks:] - sums[:-ticks]))
    return slice(start, start + ticks)


def cycle_duration(view: View) -> float:
    """Duration of one stroke to and fro, 1 to 10 s; 1 s for a motion that hardly reverses."""
    speed = view.motion.speed
    turns = np.flatnonzero(np.diff(np.sign(speed - np.mean(speed))) != 0)
    if len(turns) < 3:
        return LOOKED_AT
    strokes = np.diff(turns) * view.period
    # Noise at standstill reverses too. Weighted by their duration, the strokes outweigh it.
    typical = float(np.sum(strokes**2) / np.sum(strokes))
    return min(max(CYCLE_FACTOR * typical, LOOKED_AT), LONGEST_CYCLE)


def make_picture(
    view: View,
    form: str,
    x: tuple[str, str],
    y: tuple[str, str],
    curves: list[PictureCurve],
    caption: str,
    logarithmic: tuple[bool, bool] = (False, False),
) -> Picture:
    return Picture(
        str(view.effect.name),
        form,
        view.recording,
        view.sensor,
        *x,
        *y,
        tuple(curves),
        logarithmic,
        caption,
    )
