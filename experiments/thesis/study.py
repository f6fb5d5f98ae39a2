"""What a study of the thesis is: jobs that can run side by side, and what is concluded from their
results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.thesis.entry import Entry
from rigtwin.numerics.arrays import Array

Result = Mapping[str, Array | float]
"""Of one job: name → array or number."""
Job = Callable[[], Result]


@dataclass(frozen=True)
class Drawing:
    """A figure of the thesis drawn anew. name: of its file, without ending; covers: the figures it
    stands for, in words."""

    name: str
    covers: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Conclusion:
    """What a study found. remarks: lines of text that stand beside the figures."""

    entries: Sequence[Entry] = ()
    drawings: Sequence[Drawing] = ()
    remarks: Sequence[str] = ()


def _no_jobs(seeds: int) -> Mapping[str, Job]:
    return {}


@dataclass(frozen=True)
class Study:
    """name: as `rigtwin reproduce` takes it; chapter: `3` to `7`, `A` or `B`; covers: the tables,
    figures and equations that can be asked for by name, such as `Table 5.1` or `Figure 5.7`.

    jobs: of the number of seeds, key → work whose result is kept on disk, so that a broken run goes
    on where it was; conclude: of the results by key.
    """

    name: str
    title: str
    chapter: str
    covers: tuple[str, ...]
    conclude: Callable[[Mapping[str, Result]], Conclusion]
    jobs: Callable[[int], Mapping[str, Job]] = _no_jobs


def span(kind: str, chapter: str, first: int, last: int) -> tuple[str, ...]:
    """`Figure 5.7` to `Figure 5.20`: span("Figure", "5.", 7, 20)."""
    return tuple(f"{kind} {chapter}{number}" for number in range(first, last + 1))


def sheet(
    rows: int, columns: int, width: float = 11.0, height: float = 3.0
) -> tuple[Figure, list[list]]:
    """An empty figure and its axes, in rows; height: of a row, inch."""
    figure = Figure(figsize=(width, height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    return figure, axes.tolist()
