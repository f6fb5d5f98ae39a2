"""Pictures of a study's results."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from rigtwin.render.panels import ASKED, SENSED
from rigtwin.render.style import COLOURS
from rigtwin.studies.tuning.evaluation import MeasureChange
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.result import TuningResult

NEUTRAL = COLOURS["other"]
PALETTE = (SENSED, ASKED, "#0f766e", "#7c3aed", NEUTRAL, "#a16207")


def draw(result: TuningResult) -> dict[str, Figure]:
    """Draw all pictures, by name."""
    figures = {
        "held-out": plot_held_out(result),
        "search": plot_search(result),
        "parameters": plot_parameters(result),
    }
    two = len(result.study.goals.minimise) == 2
    return ({"front": plot_front(result)} if two else {}) | figures


def plot_search(result: TuningResult) -> Figure:
    """Draw the objectives over the candidates, in the order in which they were tried."""
    objectives = result.study.goals.minimise
    figure, axes = _sheet(len(objectives))
    allowed = _allowed(result)
    for axis, measure in zip(axes, objectives, strict=True):
        figures = _figures(result, measure)
        number = np.arange(1, len(figures) + 1)
        violating = {"color": NEUTRAL, "markersize": 4, "label": "violates a constraint"}
        axis.plot(number[~allowed], figures[~allowed], "x", **violating)
        axis.plot(number[allowed], figures[allowed], ".", color=SENSED, label="allowed")
        # The running minimum is one of costs, of which less is better.
        sign = -1.0 if measure.more else 1.0
        costs = np.where(allowed & np.isfinite(figures), sign * figures, np.inf)
        # Running minimum of the cost; infinite until the first allowed candidate.
        best = np.minimum.accumulate(costs)
        shown = np.isfinite(best)
        line = {"color": SENSED, "linewidth": 1.2, "label": "best so far"}
        axis.plot(number[shown], sign * best[shown], **line)
        before = result.baseline.figures[measure.name]
        axis.axhline(before, color=ASKED, linewidth=1.0, label="before")
        axis.set(xlabel="candidate", ylabel=_label(measure))
    axes[0].legend(fontsize=8)
    return figure


def plot_parameters(result: TuningResult) -> Figure:
    """Draw the first objective over each parameter."""
    study, measure = result.study, result.study.goals.minimise[0]
    figure, axes = _sheet(len(study.parameters), width=3.4)
    allowed, figures = _allowed(result), _figures(result, measure)
    best = result.chosen.score.figures[measure.name]
    for number, (axis, parameter) in enumerate(zip(axes, study.parameters, strict=True)):
        values = np.array([candidate.values[number] for candidate in result.candidates])
        axis.plot(values[~allowed], figures[~allowed], "x", color=NEUTRAL, markersize=4)
        axis.plot(values[allowed], figures[allowed], ".", color=SENSED)
        axis.plot(result.chosen.values[number], best, "o", color=ASKED, label="chosen")
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        axis.set(xlabel=f"{parameter.name.replace('_', ' ')}{unit}")
        if parameter.logarithmic:
            axis.set_xscale("log")
            # Few, plain numbers: over less than two decades matplotlib would label every tick.
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
            axis.xaxis.set_minor_formatter(NullFormatter())
    axes[0].set(ylabel=_label(measure))
    axes[0].legend(fontsize=8)
    return figure


def plot_front(result: TuningResult) -> Figure:
    """Draw both objectives of every candidate with the front, and the front on held-out data."""
    figure, (searched, held_out) = _sheet(2)
    _plot_candidates(searched, result)
    _plot_points(held_out, result)
    return figure


def _plot_candidates(axis: Axes, result: TuningResult) -> None:
    """Draw all candidates of the search in the plane of both objectives."""
    objectives = result.study.goals.minimise
    for label, marker, colour, chosen in (
        ("violates a constraint", "x", NEUTRAL, [x for x in result.candidates if not x.allowed]),
        ("allowed", ".", SENSED, [x for x in result.candidates if x.allowed]),
        ("front", "o-", ASKED, result.front),
    ):
        points = [[c.score.figures[measure.name] for c in chosen] for measure in objectives]
        axis.plot(*points, marker, color=colour, markersize=4, linewidth=1.0, label=label)
    before = (result.baseline.figures[measure.name] for measure in objectives)
    axis.plot(*before, "k*", markersize=10, label="before")
    first, second = objectives
    axis.set(xlabel=_label(first), ylabel=_label(second), title="search")
    axis.legend(fontsize=8)


def _plot_points(axis: Axes, result: TuningResult) -> None:
    """Draw the changes of the front's points on held-out scenarios, with intervals."""
    first, second = result.study.goals.minimise
    compared = [point for point in result.front_comparisons if point.changes]
    for point in compared:
        x, y = point.change_of(first.name), point.change_of(second.name)
        style = {"fmt": "o", "color": ASKED, "markersize": 4, "linewidth": 0.9}
        axis.errorbar(x.median, y.median, yerr=_ends(y), xerr=_ends(x), **style)
        place = {"xytext": (3, 3), "textcoords": "offset points"}
        number = point.settings.removeprefix("point ")
        axis.annotate(number, (x.median, y.median), fontsize=8, **place)
    axis.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    axis.axvline(0.0, color=NEUTRAL, linewidth=0.8)
    # A change is in percent where all scenarios have positive figures, else in the measure's
    # unit.
    labels = []
    for measure in (first, second):
        relative = any(point.change_of(measure.name).relative for point in compared)
        labels.append(f"change of {measure.title}, {'%' if relative else measure.unit}")
    axis.set(xlabel=labels[0], ylabel=labels[1], title="held out, 95 % intervals")


def plot_held_out(result: TuningResult) -> Figure:
    """Draw the change of every measure on every rig, with the interval of its median."""
    comparisons = [comparison for comparison in result.comparisons if comparison.changes]
    changes = comparisons[0].changes if comparisons else ()
    relative = [change.measure for change in changes if change.relative]
    rows = max(1, len(relative)) * max(1, len(comparisons))
    figure, (axis,) = _sheet(1, width=8.4, height=1.2 + 0.3 * rows)
    place, ticks = 0.0, []
    for measure in relative:
        start = place
        for number, comparison in enumerate(comparisons):
            change = comparison.change_of(measure.name)
            style = {"fmt": "o", "color": PALETTE[number % len(PALETTE)], "markersize": 4}
            label = None
            if measure is relative[0]:
                label = escape(f"{comparison.rig}, against {comparison.against}")
            axis.errorbar(change.median, place, xerr=_ends(change), label=label, **style)
            place += 1.0
        ticks.append((0.5 * (start + place - 1.0), measure.title))
        place += 0.7
    axis.axvline(0.0, color=NEUTRAL, linewidth=1.0)
    places, names = [position for position, _ in ticks], [name for _, name in ticks]
    axis.set(yticks=places, yticklabels=names, xlabel="change, %")
    axis.invert_yaxis()
    if comparisons:
        figure.legend(fontsize=8, loc="outside lower center", ncols=1)
    return figure


def escape(words: str) -> str:
    """Return a text escaped so that matplotlib does not typeset it as a formula."""
    return words.replace("$", r"\$")


def _sheet(columns: int, width: float = 5.2, height: float = 3.4) -> tuple[Figure, list[Axes]]:
    """Return a figure with a row of axes. It has its own canvas, so pyplot is not needed."""
    figure = Figure(figsize=(width * columns, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, squeeze=False)[0].tolist()
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    return figure, axes


def _allowed(result: TuningResult) -> np.ndarray:
    return np.array([each.allowed for each in result.candidates])


def _figures(result: TuningResult, measure: Measure) -> np.ndarray:
    return np.array([each.score.figures[measure.name] for each in result.candidates])


def _ends(change: MeasureChange) -> list[list[float]]:
    """Return the interval of a change as the ends of an error bar."""
    return [[change.median - change.low], [change.high - change.median]]


def _label(measure: Measure) -> str:
    return f"{measure.title}, {measure.unit}"
