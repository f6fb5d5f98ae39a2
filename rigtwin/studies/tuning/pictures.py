"""What came out of a study, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from rigtwin.render.plot import ASKED, SENSED
from rigtwin.render.style import COLOURS
from rigtwin.studies.tuning.evaluation import Change
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.result import TuningResult

OTHER = COLOURS["other"]
PALETTE = (SENSED, ASKED, "#0f766e", "#7c3aed", OTHER, "#a16207")


def draw(result: TuningResult) -> dict[str, Figure]:
    """Draw everything: name → figure."""
    figures = {
        "held-out": plot_held_out(result),
        "search": plot_search(result),
        "parameters": plot_parameters(result),
    }
    two = len(result.study.goals.minimise) == 2
    return ({"front": plot_front(result)} if two else {}) | figures


def plot_search(result: TuningResult) -> Figure:
    """How the objectives fell as candidates were tried."""
    objectives = result.study.goals.minimise
    figure, axes = _sheet(len(objectives))
    allowed = _allowed(result)
    for axis, measure in zip(axes, objectives, strict=True):
        figures = _figures(result, measure)
        number = np.arange(1, len(figures) + 1)
        violating = {"color": OTHER, "markersize": 4, "label": "violates a constraint"}
        axis.plot(number[~allowed], figures[~allowed], "x", **violating)
        axis.plot(number[allowed], figures[allowed], ".", color=SENSED, label="allowed")
        sign = -1.0 if measure.more else 1.0
        costs = np.where(allowed & np.isfinite(figures), sign * figures, np.inf)
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
    """The first objective over each parameter."""
    study, measure = result.study, result.study.goals.minimise[0]
    figure, axes = _sheet(len(study.parameters), width=3.4)
    allowed, figures = _allowed(result), _figures(result, measure)
    best = result.chosen.score.figures[measure.name]
    for number, (axis, parameter) in enumerate(zip(axes, study.parameters, strict=True)):
        values = np.array([each.values[number] for each in result.candidates])
        axis.plot(values[~allowed], figures[~allowed], "x", color=OTHER, markersize=4)
        axis.plot(values[allowed], figures[allowed], ".", color=SENSED)
        axis.plot(result.chosen.values[number], best, "o", color=ASKED, label="chosen")
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        axis.set(xlabel=f"{parameter.name.replace('_', ' ')}{unit}")
        if parameter.logarithmic:
            axis.set_xscale("log")
            # Plain numbers, and few: over less than two decades each line would have its label.
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
            axis.xaxis.set_minor_formatter(NullFormatter())
    axes[0].set(ylabel=_label(measure))
    axes[0].legend(fontsize=8)
    return figure


def plot_front(result: TuningResult) -> Figure:
    """Both objectives of every candidate, and the front; beside it the front held out."""
    figure, (left, right) = _sheet(2)
    _plot_candidates(left, result)
    _plot_points(right, result)
    return figure


def _plot_candidates(axis: Axes, result: TuningResult) -> None:
    objectives = result.study.goals.minimise
    for label, marker, colour, chosen in (
        ("violates a constraint", "x", OTHER, [x for x in result.candidates if not x.allowed]),
        ("allowed", ".", SENSED, [x for x in result.candidates if x.allowed]),
        ("front", "o-", ASKED, result.front),
    ):
        points = [[each.score.figures[one.name] for each in chosen] for one in objectives]
        axis.plot(*points, marker, color=colour, markersize=4, linewidth=1.0, label=label)
    before = (result.baseline.figures[measure.name] for measure in objectives)
    axis.plot(*before, "k*", markersize=10, label="before")
    one, other = objectives
    axis.set(xlabel=_label(one), ylabel=_label(other), title="search")
    axis.legend(fontsize=8)


def _plot_points(axis: Axes, result: TuningResult) -> None:
    """Changes of the front on held-out scenarios, with intervals."""
    one, other = result.study.goals.minimise
    compared = [each for each in result.front_comparisons if each.changes]
    for each in compared:
        x, y = each.of(one.name), each.of(other.name)
        style = {"fmt": "o", "color": ASKED, "markersize": 4, "linewidth": 0.9}
        axis.errorbar(x.median, y.median, yerr=_ends(y), xerr=_ends(x), **style)
        place = {"xytext": (3, 3), "textcoords": "offset points"}
        number = each.settings.removeprefix("point ")
        axis.annotate(number, (x.median, y.median), fontsize=8, **place)
    axis.axhline(0.0, color=OTHER, linewidth=0.8)
    axis.axvline(0.0, color=OTHER, linewidth=0.8)
    labels = []
    for measure in (one, other):
        relative = any(each.of(measure.name).relative for each in compared)
        labels.append(f"change of {measure.title}, {'%' if relative else measure.unit}")
    axis.set(xlabel=labels[0], ylabel=labels[1], title="held out, 95 % intervals")


def plot_held_out(result: TuningResult) -> Figure:
    """Every measure's change on every rig, with the interval of its median."""
    comparisons = [each for each in result.comparisons if each.changes]
    changes = comparisons[0].changes if comparisons else ()
    relative = [change.measure for change in changes if change.relative]
    rows = max(1, len(relative)) * max(1, len(comparisons))
    figure, (axis,) = _sheet(1, width=8.4, height=1.2 + 0.3 * rows)
    place, ticks = 0.0, []
    for measure in relative:
        start = place
        for number, each in enumerate(comparisons):
            change = each.of(measure.name)
            style = {"fmt": "o", "color": PALETTE[number % len(PALETTE)], "markersize": 4}
            label = None
            if measure is relative[0]:
                label = escape(f"{each.rig}, against {each.against}")
            axis.errorbar(change.median, place, xerr=_ends(change), label=label, **style)
            place += 1.0
        ticks.append((0.5 * (start + place - 1.0), measure.title))
        place += 0.7
    axis.axvline(0.0, color=OTHER, linewidth=1.0)
    places, names = [at for at, _ in ticks], [name for _, name in ticks]
    axis.set(yticks=places, yticklabels=names, xlabel="change, %")
    axis.invert_yaxis()
    if comparisons:
        figure.legend(fontsize=8, loc="outside lower center", ncols=1)
    return figure


def escape(words: str) -> str:
    """Words as matplotlib takes them as they are, and not for a formula."""
    return words.replace("$", r"\$")


def _sheet(columns: int, width: float = 5.2, height: float = 3.4) -> tuple[Figure, list[Axes]]:
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


def _ends(change: Change) -> list[list[float]]:
    """The interval as an error bar."""
    return [[change.median - change.low], [change.high - change.median]]


def _label(measure: Measure) -> str:
    return f"{measure.title}, {measure.unit}"
