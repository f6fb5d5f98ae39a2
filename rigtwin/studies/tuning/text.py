"""Results of a study in words and tables, for the terminal and for its page."""

from __future__ import annotations

import math

from rigtwin.console import table
from rigtwin.description.catalogue import own_description
from rigtwin.description.configuration import parameters
from rigtwin.studies.tuning.evaluation import MeasureChange, SettingsComparison, Spread
from rigtwin.studies.tuning.result import TUNED_NOMINAL, TuningResult, settings_of
from rigtwin.studies.tuning.scenario import NOMINAL
from rigtwin.studies.tuning.study import Constraint, Study

CLOSE = 0.02
"""Share of a bound within which a figure counts as respecting it. The search ends at the bound, and
held-out roads scatter about it."""
HEADER = (
    *("measure", "unit", "before", "5 to 95 %", "after", "5 to 95 %"),
    *("change", "95 % of the median", "no worse in"),
)


def number(value: float) -> str:
    """Return a number with four significant digits."""
    return f"{value:.4g}"


def percent(share: float) -> str:
    """Return a share in whole percents."""
    return f"{100.0 * share:.0f} %"


def spread(quantiles: Spread) -> tuple[str, str]:
    """Return the median, and the interval from 5 to 95 %."""
    return number(quantiles.median), f"{number(quantiles.low)} to {number(quantiles.high)}"


def change(difference: MeasureChange) -> tuple[str, str]:
    """Return the median of a change, and its interval."""
    unit = " %" if difference.relative else ""
    interval = "too few for an interval"
    if math.isfinite(difference.low):
        interval = f"{difference.low:+.3g} to {difference.high:+.3g}{unit}"
    return f"{difference.median:+.3g}{unit}", interval


def change_in_words(difference: MeasureChange) -> str:
    """Return the measure's title, its change, and the change's interval."""
    median, interval = change(difference)
    return f"{difference.measure.title} {median} [{interval}]"


def row(difference: MeasureChange) -> tuple[str, ...]:
    """Return the cells below HEADER."""
    measure = difference.measure
    spreads = (*spread(difference.before), *spread(difference.after))
    return measure.title, measure.unit, *spreads, *change(difference), percent(difference.better)


def heading(comparison: SettingsComparison) -> str:
    """Return the heading of a comparison: settings, rig and number of scenarios."""
    settings = f"{comparison.settings} against {comparison.against}"
    return f"{settings}, {comparison.rig}, {comparison.runs} held-out scenarios"


def remarks(comparison: SettingsComparison) -> list[str]:
    """Return remarks on a comparison: the share of safety limits, and trips."""
    before, after = map(percent, comparison.trips)
    lines = [f"at most {percent(comparison.limits)} of a safety limit"]
    if max(comparison.trips) > 0.0:
        lines.append(f"tripped: {after} of the runs, {before} before; those are not compared")
    return lines


def sentence(result: TuningResult) -> str:
    """Return the result in one sentence."""
    main, goals = result.main, result.study.goals
    if not main.changes:
        tripped = f"Every held-out run of one of the two tripped on the {result.rig}"
        return f"{tripped}: nothing can be compared."
    gained = " and ".join(
        change_in_words(main.change_of(measure.name)) for measure in goals.minimise
    )
    held = [constraint_in_words(main, constraint) for constraint in goals.constraints]
    beside = f", with {', '.join(held)}" if held else ""
    return f"On {main.runs} held-out scenarios {gained}{beside}."


def constraint_in_words(comparison: SettingsComparison, constraint: Constraint) -> str:
    """Return a constraint on held-out scenarios: the change, or the figure beside its bound."""
    difference = comparison.change_of(constraint.measure.name)
    if not math.isnan(constraint.share):
        return change_in_words(difference)
    measure = difference.measure
    bound = f"{'at least' if measure.more else 'at most'} {number(constraint.bound)}"
    return f"{measure.title} {number(difference.quantile)} {measure.unit} ({bound})"


def concerns(result: TuningResult) -> list[str]:
    """Return what speaks against the settings, on every rig they are evaluated on."""
    main, goals = result.main, result.study.goals
    lines = []
    for comparison in result.comparisons:
        if comparison.against != main.against:
            continue
        rig, (before, after) = comparison.rig, comparison.trips
        if after > before:
            lines.append(f"{rig}: {percent(after)} of the runs trip, {percent(before)} before")
        elif comparison.limits > goals.limits:
            reached, allowed = percent(comparison.limits), percent(goals.limits)
            lines.append(f"{rig}: {reached} of a safety limit, {allowed} allowed")
        if comparison.changes:
            violations = [_violation(comparison, constraint) for constraint in goals.constraints]
            lines += [f"{rig}: {violation}" for violation in violations if violation]
    objectives = [measure.name for measure in goals.minimise]
    if not (main.changes and any(main.change_of(name).improved for name in objectives)):
        lines.append(f"no objective is certainly better than {main.against}")
    return lines


def _violation(comparison: SettingsComparison, constraint: Constraint) -> str | None:
    """Return how held-out scenarios violate a constraint, or None if they do not."""
    difference = comparison.change_of(constraint.measure.name)
    measure, figure = difference.measure, difference.quantile
    if math.isnan(constraint.share):
        bound = constraint.bound
        if (bound - figure if measure.more else figure - bound) <= CLOSE * abs(bound):
            return None
        return f"{measure.title} is {number(figure)} {measure.unit}, bound {number(bound)}"
    # The bound is a share of the baseline's figure, so the allowed change is in % of that figure,
    # or in its unit. Only the interval's near end counts: a violation must be certain.
    usual = 100.0 if difference.relative else difference.before.median
    allowed = usual * (constraint.share - 1.0)
    beyond = allowed - difference.high if measure.more else difference.low - allowed
    slack = 0.0 if difference.relative else CLOSE * abs(difference.before.median)
    # Written so that a missing interval, NaN, is no violation.
    if not beyond > slack:
        return None
    return f"{measure.title} is certainly beyond its bound: {change(difference)[1]}"


def notes(result: TuningResult) -> list[str]:
    """Return remarks on the study's setup."""
    study, before = result.study, result.study.baseline_settings
    lines = []
    for parameter in study.parameters:
        value = getattr(before, parameter.name)
        if not parameter.low <= value <= parameter.high:
            bounds = f"outside the bounds {number(parameter.low)} to {number(parameter.high)}"
            lines.append(
                f"{parameter.key} is {number(value)} before, {bounds}: "
                "the search began at the bound"
            )
    if result.same_scenarios:
        lines.append(
            f"{study.experiment.name} is the same test whatever its seed: "
            "only noise differs between these scenarios"
        )
    return lines


def alternatives(result: TuningResult) -> list[str]:
    """Return the benefit of the diagnosis if it is right, and the loss if it is wrong."""
    lines = []
    for comparison in result.comparisons:
        if comparison.against != TUNED_NOMINAL or not comparison.changes:
            continue
        condition = f"on the {comparison.rig}"
        if comparison.rig == NOMINAL.name:
            condition = "if the diagnosis were wrong and the rig nominal"
        first = change_in_words(comparison.change_of(result.study.goals.minimise[0].name))
        lines.append(f"{condition}: {first} against settings {TUNED_NOMINAL}")
    return lines


def values(result: TuningResult) -> list[tuple[str, ...]]:
    """Return the table of parameters: before, after, bounds and unit."""
    before = result.study.baseline_settings
    rows = [("parameter", "before", "after", "between", "unit")]
    for parameter, value in zip(result.study.parameters, result.chosen.values, strict=True):
        old = number(getattr(before, parameter.name))
        at_end = " (at its bound)" if value in (parameter.low, parameter.high) else ""
        bounds = f"{number(parameter.low)} to {number(parameter.high)}"
        rows.append((parameter.key, old, number(value) + at_end, bounds, parameter.unit))
    return rows


def text(result: TuningResult) -> str:
    """Return all results as plain text."""
    beside = [*(f"but {line}" for line in concerns(result)), *notes(result)]
    head = "\n".join([result.study.title, sentence(result), *beside])
    blocks = [head, table(values(result))]
    for comparison in (*result.comparisons, *result.front_comparisons):
        cells = [HEADER, *map(row, comparison.changes)]
        figures = table(cells) if comparison.changes else "nothing to compare"
        blocks.append("\n".join([heading(comparison), figures, *remarks(comparison)]))
    if lines := alternatives(result):
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def command(study: Study, settings: object) -> str:
    """Return the command line that runs a study's experiment with settings from a file."""
    machine = own_description(study.machine) or study.machine.name
    return f"rigtwin run {study.experiment.name} --machine {machine} --config {settings}"


def toml(result: TuningResult, point: int | None = None) -> str:
    """Return the settings that differ from the experiment's, as TOML text for `run --config`.

    Parameters
    ----------
    result
        Results of the study.
    point
        Index of a point of the front. Defaults to the chosen candidate.
    """
    study = result.study
    candidate = result.chosen if point is None else result.front[point]
    comparison = result.main if point is None else result.front_comparisons[point]
    where = f"tuned on the {result.rig}, seed {result.seed}, {study.budget.roads} scenarios"
    lines = [f"# {study.title}", f"# {where}"]
    for difference in comparison.changes:
        median, interval = change(difference)
        lines.append(f"# {difference.measure.title}: {median} [{interval}] held out")
    lines += [f"# but {line}" for line in (concerns(result) if point is None else ())]
    lines += [f"# {command(study, 'THIS.toml')}", "", "[controller]"]
    # Only settings that differ are written, so that later defaults of the experiment still apply.
    before = {key: value for key, value, _ in parameters(study.experiment.configuration)}
    for name, value in settings_of(study, candidate)._asdict().items():
        if value != before[f"controller.{name}"]:
            # An enumeration is written by its label.
            content = f'"{value.label}"' if hasattr(value, "label") else repr(value)
            lines.append(f"{name} = {content}")

    return "\n".join(lines) + "\n"
