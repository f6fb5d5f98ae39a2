"""Plots of a recording: motions, forces and commands over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, printable
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.render.panels import ASKED, PANELS, RIG_SENSORS, SENSED, Panel, Trace, plain
from rigtwin.render.style import STYLES, Style

MOST_PANELS = 40
"""Maximum number of panels; the title names how many were left out."""
LARGEST = 1e100
"""Largest value of a signal that matplotlib's axes can scale."""
KINDS = (".png", ".svg", ".pdf")


def _plain_panels(recording: RecordedTest) -> tuple[Panel, ...]:
    """Return a panel for every channel name of another machine.

    A command and a sensor of the same name share a panel.
    """
    names = dict.fromkeys(name for columns in recording.columns.values() for name in columns)
    # The twin's true signals are left out: a rig does not have them.
    labels = {"/sensor": ("measured", SENSED), "/command": ("commanded", ASKED)}
    return tuple(
        Panel(
            name,
            tuple(
                Trace(label, colour, ((topic, name),), plain)
                for topic, (label, colour) in labels.items()
            ),
        )
        for name in names
    )


def find_stretch(recording: RecordedTest, start: float, until: float | None) -> slice:
    """Return the ticks of a stretch of time.

    Parameters
    ----------
    recording : RecordedTest
        Recording that contains the stretch.
    start, until : float
        Times in s. The stretch reaches to the end if `until` is None.

    Returns
    -------
    slice
        At least two ticks.

    Raises
    ------
    RigtwinError
        If the stretch is empty or a time is not finite.
    """
    if recording.ticks < 2:
        raise RigtwinError(
            f"{recording.path}: it has {recording.ticks} ticks; expected two or more"
        )
    end = float(recording.time[-1]) if until is None else until
    if not (math.isfinite(start) and math.isfinite(end)):
        raise RigtwinError(f"start {start:g} s, until {end:g} s: expected finite times")
    # Half a period of tolerance includes a last tick that rounding has moved.
    first, last = np.searchsorted(recording.time, [start, end + recording.period / 2])
    if last - first < 2:
        span = f"{recording.time[0]:g} to {recording.time[-1]:.3f} s"
        raise RigtwinError(
            f"{recording.path}: nothing between {start:g} and {end:g} s; it has {span}"
        )
    return slice(int(first), int(last))


def draw(
    recording: RecordedTest,
    out: Path,
    start: float = 0.0,
    until: float | None = None,
    style: Style = STYLES["screen"],
    panels: Sequence[str] = (),
) -> None:
    """Plot a recording of any machine into a file.

    Parameters
    ----------
    recording : RecordedTest
        Recording of any machine.
    out : Path
        Path of a png, svg or pdf file.
    start, until : float
        Times in s. The stretch reaches to the end if `until` is None.
    style : Style
        Style of the figure.
    panels : sequence of str
        Beginnings of the panels' titles, in the order to be drawn. Defaults to all panels.

    Raises
    ------
    RigtwinError
        If the file name has another ending, the stretch is empty, or a panel does not exist.
    """
    check_ending(out)
    ticks = find_stretch(recording, start, until)
    with style.used():
        save(_figure(recording, ticks, style, panels), out, style.dpi)


def _panels(recording: RecordedTest, wanted: Sequence[str]) -> list[tuple[str, list[Trace]]]:
    """Return titles and traces of the panels that the recording has data for."""
    candidates = (
        PANELS
        if all(recording.has("/sensor", name) for name in RIG_SENSORS)
        else _plain_panels(recording)
    )
    available = [
        (
            panel.title,
            [
                trace
                for trace in panel.traces
                if all(recording.has(*channel) for channel in trace.needs)
            ],
        )
        for panel in candidates
    ]
    available = [(title, traces) for title, traces in available if traces]
    for name in wanted:
        if not any(title.startswith(name) for title, _ in available):
            titles = ", ".join(repr(title) for title, _ in available)
            raise RigtwinError(f"{recording.path}: no panel {name!r}; expected one of {titles}")
    if wanted:
        available = [panel for name in wanted for panel in available if panel[0].startswith(name)]
    return available


def _figure(recording: RecordedTest, ticks: slice, style: Style, panels: Sequence[str]) -> Figure:
    time, shown = recording.time[ticks], _panels(recording, panels)
    left_out = f" · {MOST_PANELS} of {len(shown)} channels" if len(shown) > MOST_PANELS else ""
    shown = shown[:MOST_PANELS]
    figure = Figure(
        figsize=(style.width, style.panel * len(shown) + style.rest), layout="constrained"
    )
    FigureCanvasAgg(figure)
    # One time axis for all, so that zooming and gaps line up.
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (title, traces) in zip(axes, shown, strict=True):
        for trace in traces:
            signal = trace.value(*(recording.column(*channel)[ticks] for channel in trace.needs))
            # NaN marks missing values; it is no reason to refuse a plot.
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
        # Time fills the width: a margin would look like missing data.
        axis.margins(x=0)
    # Titles of the panels share one vertical line whatever their numbers' width.
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("time, s", fontsize=style.text)
    if not style.titled:
        return figure
    ending = f" · {recording.end}" if recording.end else ""
    about = f"{recording.path.name} · {recording.experiment}{ending}{left_out}"
    # A file name in another encoding has characters that matplotlib cannot draw.
    about = printable(about.encode("utf-8", "replace").decode())
    figure.suptitle(about, fontsize=11, parse_math=False)
    return figure


def _part(time: Array, signal: Array, period: float) -> tuple[Array, Array]:
    """Return a signal with NaN inserted at gaps, where no line must be drawn."""
    # NaN interrupts a line in matplotlib.
    gaps = np.nonzero(np.diff(time) > 1.5 * period)[0] + 1
    return np.insert(time, gaps, np.nan), np.insert(signal, gaps, np.nan)


def check_ending(out: Path) -> None:
    """Raise RigtwinError unless the file name ends in a supported image format."""
    if out.suffix.lower() not in KINDS:
        raise RigtwinError(f"cannot draw {out.name!r}: the name must end in {', '.join(KINDS)}")


def save(figure: Figure, out: Path, dpi: int = STYLES["screen"].dpi) -> None:
    """Write a figure. Raise RigtwinError if the file cannot be written."""
    # Drawn in memory first: a failure while drawing must not leave half a file.
    drawn = BytesIO()
    figure.savefig(drawn, dpi=dpi, format=out.suffix[1:].lower())
    atomic_write(out, drawn.getvalue())
