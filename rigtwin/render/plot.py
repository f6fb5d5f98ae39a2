"""Draws a recording: what moved, what pushed, and what the controller asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rigtwin.errors import RigtwinError
from rigtwin.files import printable, write_whole
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.render.style import COLOURS, STYLES, Style

RIG_SENSORS = ("structure_lvdt", "load_cell")
"""By which a quarter car's recording is known."""
MOST_PANELS = 40
LARGEST = 1e100
"""A picture's axis has no room for more."""
KINDS = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class Trace:
    """One line of a panel. needs: its channels; value: of them, in the panel's unit."""

    label: str
    colour: str
    needs: tuple[tuple[str, str], ...]
    value: Callable[..., Array]


@dataclass(frozen=True)
class Panel:
    """Lines that share an axis."""

    title: str
    traces: tuple[Trace, ...]


def _millimetres(position: Array) -> Array:
    return 1e3 * position


def _wheel(structure: Array, travel: Array) -> Array:
    return 1e3 * (structure - travel)


def _plain(signal: Array) -> Array:
    return signal


SENSED, ASKED = COLOURS["measured"], COLOURS["commanded"]
PANELS = (
    Panel(
        "ground, mm",
        (
            Trace("measured", SENSED, (("/sensor", "ground_lvdt"),), _millimetres),
            Trace("commanded", ASKED, (("/command", "ground"),), _millimetres),
        ),
    ),
    Panel(
        "plate (sprung mass), mm",
        (
            Trace("measured", SENSED, (("/sensor", "structure_lvdt"),), _millimetres),
            Trace("commanded", ASKED, (("/command", "structure"),), _millimetres),
        ),
    ),
    Panel(
        "suspension travel, mm",
        (Trace("measured", SENSED, (("/sensor", "suspension_lvdt"),), _millimetres),),
    ),
    Panel(
        "wheel, mm",
        (
            Trace(
                "plate − travel",
                SENSED,
                (("/sensor", "structure_lvdt"), ("/sensor", "suspension_lvdt")),
                _wheel,
            ),
        ),
    ),
    Panel(
        "suspension force, N",
        (
            Trace("measured", SENSED, (("/sensor", "load_cell"),), _plain),
            Trace("demanded", ASKED, (("/command", "force"),), _plain),
        ),
    ),
    Panel("motor voltage, V", (Trace("commanded", ASKED, (("/command", "voltage"),), _plain),)),
)
"""What is drawn, from top to bottom; a panel without data is left out."""


def _plain_panels(recording: Recording) -> tuple[Panel, ...]:
    """A panel for every channel name of another machine.

    What was commanded and what was sensed under one name together.
    """
    names = dict.fromkeys(name for columns in recording.columns.values() for name in columns)
    labels = {"/sensor": ("measured", SENSED), "/command": ("commanded", ASKED)}
    return tuple(
        Panel(
            name,
            tuple(
                Trace(label, colour, ((topic, name),), _plain)
                for topic, (label, colour) in labels.items()
            ),
        )
        for name in names
    )


def find_stretch(recording: Recording, start: float, until: float | None) -> slice:
    """Finds the ticks of a stretch of time.

    Parameters
    ----------
    recording : Recording
        Whose ticks.
    start, until : float
        s; to the end where `until` is None.

    Returns
    -------
    slice
        Two ticks at least.

    Raises
    ------
    RigtwinError
        If there are none.
    """
    end = float(recording.time[-1]) if until is None else until
    if not (math.isfinite(start) and math.isfinite(end)):
        raise RigtwinError(f"--from {start:g} --until {end:g}: expected times in s")
    first, last = np.searchsorted(recording.time, [start, end + recording.period / 2])
    if last - first < 2:
        span = f"{recording.time[0]:g} to {recording.time[-1]:.3f} s"
        raise RigtwinError(
            f"{recording.path}: nothing between {start:g} and {end:g} s; it has {span}"
        )
    return slice(int(first), int(last))


def draw(
    recording: Recording,
    out: Path,
    start: float = 0.0,
    until: float | None = None,
    style: Style = STYLES["screen"],
    panels: Sequence[str] = (),
) -> None:
    """Draws a recording: what moved, what pushed, what was commanded.

    Parameters
    ----------
    recording : Recording
        Of any machine.
    out : Path
        A png, svg or pdf file.
    start, until : float
        s; to the end where `until` is None.
    style : Style
        How it looks.
    panels : sequence of str
        What their titles begin with, in the order in which they are drawn; all by default.

    Raises
    ------
    RigtwinError
        For another ending, an empty stretch, or a panel that it does not have.
    """
    check_ending(out)
    ticks = find_stretch(recording, start, until)
    with style.used():
        save(_figure(recording, ticks, style, panels), out, style.dpi)


def _panels(recording: Recording, wanted: Sequence[str]) -> list[tuple[str, list[Trace]]]:
    """Titles and traces of the panels that it has data for."""
    every = (
        PANELS
        if all(recording.has("/sensor", name) for name in RIG_SENSORS)
        else _plain_panels(recording)
    )
    there = [
        (
            panel.title,
            [
                trace
                for trace in panel.traces
                if all(recording.has(*channel) for channel in trace.needs)
            ],
        )
        for panel in every
    ]
    there = [(title, traces) for title, traces in there if traces]
    for name in wanted:
        if not any(title.startswith(name) for title, _ in there):
            titles = ", ".join(repr(title) for title, _ in there)
            raise RigtwinError(f"{recording.path}: no panel {name!r}; there are {titles}")
    if wanted:
        there = [each for name in wanted for each in there if each[0].startswith(name)]
    return there


def _figure(recording: Recording, ticks: slice, style: Style, panels: Sequence[str]) -> Figure:
    time, there = recording.time[ticks], _panels(recording, panels)
    left_out = f" · {MOST_PANELS} of {len(there)} channels" if len(there) > MOST_PANELS else ""
    there = there[:MOST_PANELS]
    figure = Figure(
        figsize=(style.width, style.panel * len(there) + style.rest), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(there), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (title, traces) in zip(axes, there, strict=True):
        for trace in traces:
            signal = trace.value(*(recording.column(*channel)[ticks] for channel in trace.needs))
            if np.max(np.abs(signal), initial=0.0, where=~np.isnan(signal)) > LARGEST:
                raise RigtwinError(
                    f"{recording.path}: {title} goes beyond {LARGEST:g}, which cannot be drawn"
                )
            axis.plot(
                *_part(time, signal, recording.period),
                color=trace.colour,
                linewidth=style.line,
                linestyle=style.dashed if trace.colour == ASKED else "-",
                label=trace.label,
            )
        axis.set_ylabel(title, fontsize=style.text, parse_math=False)
        axis.grid(alpha=0.3)
        axis.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 0.97),
            fontsize=style.text - 1.0,
            frameon=False,
            ncols=2,
            borderpad=0.1,
        )
        axis.margins(x=0)
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("time, s", fontsize=style.text)
    if not style.titled:
        return figure
    ending = f" · {recording.end}" if recording.end else ""
    about = f"{recording.path.name} · {recording.experiment}{ending}{left_out}"
    about = printable(about.encode("utf-8", "replace").decode())
    figure.suptitle(about, fontsize=11, parse_math=False)
    return figure


def _part(time: Array, signal: Array, period: float) -> tuple[Array, Array]:
    """A signal without a line across what was not recorded."""
    gaps = np.nonzero(np.diff(time) > 1.5 * period)[0] + 1
    return np.insert(time, gaps, np.nan), np.insert(signal, gaps, np.nan)


def check_ending(out: Path) -> None:
    """Raises RigtwinError unless a figure can be written to that name."""
    if out.suffix.lower() not in KINDS:
        raise RigtwinError(f"cannot draw {out.name!r}: the name must end in {', '.join(KINDS)}")


def save(figure: Figure, out: Path, dpi: int = STYLES["screen"].dpi) -> None:
    """Writes a figure. Raises RigtwinError if the file cannot be written."""
    drawn = BytesIO()
    figure.savefig(drawn, dpi=dpi, format=out.suffix[1:].lower())
    write_whole(out, drawn.getvalue())
