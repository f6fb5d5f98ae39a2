"""The diagnosis as one HTML file to look at: no network, no script, readable on a telephone."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigtwin import __version__
from rigtwin.diagnosis.attribute import library
from rigtwin.diagnosis.finding import Answer
from rigtwin.diagnosis.text import number
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import spectrum

if TYPE_CHECKING:
    from rigtwin.diagnosis.result import Diagnosis

BEFORE, AFTER, FLOOR = "#c2410c", "#0f766e", "#94a3b8"
BINS = 24
"""Of velocity."""
COUNTED = 30
"""Ticks that a bin must hold to be drawn."""


@dataclass(frozen=True)
class Bar:
    """A gap before and after in noise floors, and the widths of its bars in percent."""

    name: str
    before: float
    after: float
    before_width: float
    after_width: float
    floor_width: float


def bars(answer: Answer) -> list[Bar]:
    """All sensors together, then each component's replay; widths on a scale common to all, of
    square roots so that small ones show beside large ones."""
    if answer.gap is None:
        return []
    gap = answer.gap
    levels = [("all sensors", gap.before, gap.after)]
    levels += [
        (name.replace("_", " "), level.before, level.after) for name, level in gap.replays.items()
    ]
    largest = max(max(before, after, 1.0) for _, before, after in levels)

    def width(value: float) -> float:
        return 100.0 * (value / largest) ** 0.5

    return [Bar(name, b, a, width(b), width(a), width(1.0)) for name, b, a in levels]


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rigtwin"}):
        figure.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def _axes(title: str, x: str, y: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.2, 3.2))
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x, fontsize=10)
    axes.set_ylabel(y, fontsize=10)
    axes.grid(True, color="#e2e8f0", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def plots(diagnosis: Diagnosis) -> list[str]:
    """What is left of the sensor with the largest gap by velocity, frequency and time, before and
    after, as SVG."""
    evidence = diagnosis.evidence
    if evidence is None:
        return []
    before, after = (
        evidence.differences(evidence.plant)[0],
        evidence.differences(diagnosis.corrected.plant)[0],
    )
    each, recording = evidence.lines[0], evidence.recordings[0]
    row = int(np.argmax(np.mean(before**2, axis=1) / each.noise**2))
    name, unit = evidence.names[row], evidence.machine.rows[row].unit
    scale, unit = (1e3, "mm") if unit == "m" else (1.0, unit)
    corrected = bool(diagnosis.answer.effects)
    curves = [("before", BEFORE, scale * before[row])] + (
        [("after", AFTER, scale * after[row])] if corrected else []
    )
    component = diagnosis.answer.where[0].component if diagnosis.answer.where else name
    speed = evidence.models[0].motion(component, evidence.plant).speed
    noise = scale * float(each.noise[row])
    return [
        _by_velocity(curves, speed, noise, name, unit),
        _by_frequency(curves, recording.period, noise, name, unit),
        _by_time(curves, recording.time, noise, name, unit),
    ]


def _by_velocity(
    curves: list[tuple[str, str, Array]], speed: Array, noise: float, name: str, unit: str
) -> str:
    figure, axes = _axes(f"{name} by velocity", "velocity, m/s", f"mean of what is left, {unit}")
    slowest, fastest = np.quantile(speed, [0.002, 0.998])
    edges = np.linspace(slowest, fastest, BINS + 1)
    place = np.digitize(speed, edges) - 1
    centres = 0.5 * (edges[1:] + edges[:-1])
    for label, colour, values in curves:
        means = [
            float(np.mean(values[place == b])) if np.sum(place == b) >= COUNTED else np.nan
            for b in range(BINS)
        ]
        axes.plot(centres, means, "o-", color=colour, markersize=3, linewidth=1.4, label=label)
    axes.axhspan(
        -noise, noise, color=FLOOR, alpha=0.25, linewidth=0, label="noise, 1 σ of one sample"
    )
    axes.legend(fontsize=9, frameon=False)
    return _svg(figure)


def _by_frequency(
    curves: list[tuple[str, str, Array]], period: float, noise: float, name: str, unit: str
) -> str:
    figure, axes = _axes(f"{name} by frequency", "Hz", f"{unit}/√Hz")
    for label, colour, values in curves:
        frequency, density = spectrum(values, period)
        shown = (frequency > 0) & (frequency <= 200)
        axes.loglog(
            frequency[shown], np.sqrt(density[shown]), color=colour, linewidth=1.1, label=label
        )
    axes.axhline(noise * np.sqrt(2 * period), color=FLOOR, linewidth=1.4, label="noise")
    axes.legend(fontsize=9, frameon=False)
    return _svg(figure)


def _by_time(
    curves: list[tuple[str, str, Array]], time: Array, noise: float, name: str, unit: str
) -> str:
    figure, axes = _axes(f"{name} by time", "s", f"rms of what is left, {unit}")
    block = max(1, len(time) // 80)
    count = len(time) // block
    middle = time[: count * block].reshape(count, block).mean(axis=1)
    for label, colour, values in curves:
        rms = np.sqrt((values[: count * block].reshape(count, block) ** 2).mean(axis=1))
        axes.plot(middle, rms, color=colour, linewidth=1.3, label=label)
    axes.axhline(noise, color=FLOOR, linewidth=1.4, label="noise")
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=9, frameon=False)
    return _svg(figure)


def html(diagnosis: Diagnosis) -> str:
    """The page."""
    environment = Environment(
        loader=PackageLoader("rigtwin.diagnosis"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    answer = diagnosis.answer
    guilty = {effect.name.component for effect in answer.effects} | {
        place.component for place in answer.where
    }
    return environment.get_template("report.html").render(
        diagnosis=answer,
        guilty=guilty,
        bars=bars(answer),
        plots=plots(diagnosis),
        number=number,
        title=diagnosis.described.title,
        components=list(diagnosis.evidence.machine.components)
        if diagnosis.evidence is not None
        else [],
        tried=len(library(diagnosis.evidence)) if diagnosis.evidence is not None else 0,
        version=__version__,
    )


def write(path: Path, diagnosis: Diagnosis) -> Path:
    """Writes the page. Raises RigtwinError if it cannot."""
    try:
        path.write_text(html(diagnosis), encoding="utf-8")
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
    return path
