"""A study of the thesis: jobs that can run in parallel, and a conclusion from their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.thesis.entry import Entry
from rigtwin.numerics.arrays import Array

Result = Mapping[str, Array | float]
"""Result of one job: arrays or numbers by name."""
Job = Callable[[], Result]
"""Work of one job."""


@dataclass(frozen=True)
class Drawing:
    """A figure of the thesis drawn from computed results.

    Attributes
    ----------
    name : str
        Name of the file, without its suffix.
    covers : str
        Figures of the thesis that the drawing reproduces, such as `Figure 3.11 to 3.14`.
    caption : str
        Caption.
    figure : matplotlib.figure.Figure
        Drawing.
    """

    name: str
    covers: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Conclusion:
    """Conclusion of a study.

    Attributes
    ----------
    entries : sequence of Entry
        Printed results beside the computed ones.
    drawings : sequence of Drawing
        Reproduced figures.
    remarks : sequence of str
        Further findings, one paragraph each.
    """

    entries: Sequence[Entry] = ()
    drawings: Sequence[Drawing] = ()
    remarks: Sequence[str] = ()


def _no_jobs(seeds: int) -> Mapping[str, Job]:
    """Return no jobs: the study concludes from closed forms alone."""
    return {}


@dataclass(frozen=True)
class ThesisStudy:
    """A study of one section of the thesis.

    Attributes
    ----------
    name : str
        Name, as `rigtwin reproduce` takes it.
    title : str
        Title.
    chapter : str
        Chapters, separated by spaces: `3` to `7`, `A` or `B`.
    covers : tuple of str
        Tables, figures and equations that can be reproduced by name, such as `Table 5.1`.
    conclude : callable
        Function of the results by key that returns the conclusion.
    jobs : callable
        Function of the number of seeds that returns the jobs by key. Results are stored on disk,
        so an interrupted run resumes. Defaults to no jobs.
    """

    name: str
    title: str
    chapter: str
    covers: tuple[str, ...]
    conclude: Callable[[Mapping[str, Result]], Conclusion]
    jobs: Callable[[int], Mapping[str, Job]] = _no_jobs


def span(kind: str, chapter: str, first: int, last: int) -> tuple[str, ...]:
    """Return consecutive names: span("Figure", "5.", 7, 20) is `Figure 5.7` to `Figure 5.20`."""
    return tuple(f"{kind} {chapter}{number}" for number in range(first, last + 1))


def trace(
    axis: Axes,
    result: Result,
    name: str,
    shown: slice | NDArray[np.bool_] = slice(None),
    **style: Any,
) -> None:
    """Plot a stored signal over its time; shown: part of the ticks."""
    axis.plot(np.asarray(result["time"])[shown], np.asarray(result[name])[shown], **style)


def sheet(
    rows: int, columns: int, width: float = 11.0, height: float = 3.0
) -> tuple[Figure, list[list]]:
    """Return an empty figure and its axes in rows; width: of the figure, height: of a row, inch."""
    # Threads draw at the same time, so the figure bypasses pyplot and its global state.
    figure = Figure(figsize=(width, height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    return figure, axes.tolist()
