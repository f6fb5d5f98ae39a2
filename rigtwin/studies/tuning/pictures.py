"""What came out of a study, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rigtwin.render.plot import ASKED, COLOURS, SENSED
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.outcome import Outcome

OTHER = COLOURS["other"]


def _sheet(columns: int, width: float = 5.2, height: float = 3.4) -> tuple[Figure, list]:
    figure = Figure(figsize=(width * columns, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, squeeze=False)[0].tolist()
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    return figure, axes


def plain(words: str) -> str:
    """Words that matplotlib takes as they are, and not for a formula."""
    return words.replace("$", r"\$")


def _label(measure: Measure) -> str:
    return f"{measure.title}, {measure.unit}"


def searched(outcome: Outcome) -> Figure:
    """How the objectives fell as candidates were tried."""
    figure, axes = _sheet(len(outcome.study.minimise))
    allowed = np.array([each.allowed for each in outcome.tried])
    for axis, measure in zip(axes, outcome.study.minimise, strict=True):
        figures = np.array([each.worth.figures[measure.name] for each in outcome.tried])
        number = np.arange(1, len(figures) + 1)
        axis.plot(number[~allowed], figures[~allowed], "x", color=OTHER, markersize=4, label="violates a constraint")
        axis.plot(number[allowed], figures[allowed], ".", color=SENSED, label="allowed")
        least = np.where(allowed, -figures if measure.more else figures, np.inf)
        best = np.minimum.accumulate(np.where(np.isfinite(least), least, np.inf))
        shown = np.isfinite(best)
        axis.plot(number[shown], (-best if measure.more else best)[shown], color=SENSED, linewidth=1.2, label="best so far")
        axis.axhline(outcome.baseline.figures[measure.name], color=ASKED, linewidth=1.0, label="before")
        axis.set(xlabel="candidate", ylabel=_label(measure))
    axes[0].legend(fontsize=8)
    return figure


def by_parameter(outcome: Outcome) -> Figure:
    """The first objective over each parameter."""
    study, measure = outcome.study, outcome.study.minimise[0]
    figure, axes = _sheet(len(study.parameters), width=3.4)
    allowed = np.array([each.allowed for each in outcome.tried])
    figures = np.array([each.worth.figures[measure.name] for each in outcome.tried])
    for number, (axis, parameter) in enumerate(zip(axes, study.parameters, strict=True)):
        values = np.array([each.values[number] for each in outcome.tried])
        axis.plot(values[~allowed], figures[~allowed], "x", color=OTHER, markersize=4)
        axis.plot(values[allowed], figures[allowed], ".", color=SENSED)
        axis.plot(outcome.chosen.values[number], outcome.chosen.worth.figures[measure.name], "o", color=ASKED, label="chosen")
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        axis.set(xlabel=f"{parameter.key.partition('.')[2].replace('_', ' ')}{unit}")
        if parameter.logarithmic:
            axis.set_xscale("log")
    axes[0].set(ylabel=_label(measure))
    axes[0].legend(fontsize=8)
    return figure


def front(outcome: Outcome) -> Figure:
    """Both objectives of every candidate, and the front; beside it the front on held-out scenarios, with intervals."""
    one, other = outcome.study.minimise
    figure, (left, right) = _sheet(2)
    for label, marker, colour, chosen in (
        ("violates a constraint", "x", OTHER, [each for each in outcome.tried if not each.allowed]),
        ("allowed", ".", SENSED, [each for each in outcome.tried if each.allowed]),
        ("front", "o-", ASKED, list(outcome.front)),
    ):
        points = [[each.worth.figures[measure.name] for each in chosen] for measure in (one, other)]
        left.plot(*points, marker, color=colour, markersize=4, linewidth=1.0, label=label)
    left.plot(*(outcome.baseline.figures[measure.name] for measure in (one, other)), "k*", markersize=10, label="before")
    left.set(xlabel=_label(one), ylabel=_label(other), title="search")
    left.legend(fontsize=8)
    for comparison in (each for each in outcome.on_front if each.changes):
        x, y = comparison.of(one.name), comparison.of(other.name)
        right.errorbar(
            x.median,
            y.median,
            [[y.median - y.low], [y.high - y.median]],
            [[x.median - x.low], [x.high - x.median]],
            fmt="o",
            color=ASKED,
            markersize=4,
            linewidth=0.9,
        )
        right.annotate(
            comparison.settings.removeprefix("point "),
            (x.median, y.median),
            fontsize=8,
            xytext=(3, 3),
            textcoords="offset points",
        )
    right.axhline(0.0, color=OTHER, linewidth=0.8)
    right.axvline(0.0, color=OTHER, linewidth=0.8)
    units = [
        "%" if any(each.of(measure.name).relative for each in outcome.on_front if each.changes) else measure.unit
        for measure in (one, other)
    ]
    labels = [f"change of {measure.title}, {unit}" for measure, unit in zip((one, other), units, strict=True)]
    right.set(xlabel=labels[0], ylabel=labels[1], title="held out, 95 % intervals")
    return figure


def held_out(outcome: Outcome) -> Figure:
    """Every measure's change on every rig, with the interval of its median."""
    comparisons = [each for each in outcome.comparisons if each.changes]
    relative = [change.measure for change in comparisons[0].changes if change.relative] if comparisons else []
    figure, (axis,) = _sheet(1, 8.4, 1.2 + 0.3 * max(1, len(relative)) * max(1, len(comparisons)))
    place, ticks = 0.0, []
    palette = (SENSED, ASKED, "#0f766e", "#7c3aed", OTHER, "#a16207")
    for measure in relative:
        begun = place
        for number, comparison in enumerate(comparisons):
            change = comparison.of(measure.name)
            ends = [[change.median - change.low], [change.high - change.median]]
            label = plain(f"{comparison.rig}, against {comparison.against}") if measure is relative[0] else None
            axis.errorbar(
                change.median, place, xerr=ends, fmt="o", color=palette[number % len(palette)], markersize=4, label=label
            )
            place += 1.0
        ticks.append((0.5 * (begun + place - 1.0), measure.title))
        place += 0.7
    axis.axvline(0.0, color=OTHER, linewidth=1.0)
    axis.set(yticks=[at for at, _ in ticks], yticklabels=[name for _, name in ticks], xlabel="change, %")
    axis.invert_yaxis()
    if comparisons:
        figure.legend(fontsize=8, loc="outside lower center", ncols=1)
    return figure


def drawn(outcome: Outcome) -> dict[str, Figure]:
    """Name → figure."""
    found = {"held-out": held_out(outcome), "search": searched(outcome), "parameters": by_parameter(outcome)}
    return ({"front": front(outcome)} if len(outcome.study.minimise) == 2 else {}) | found
