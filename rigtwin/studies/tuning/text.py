"""What came out of a study, in words and tables; on a terminal and on its page."""

from __future__ import annotations

import math

from machines import DEFAULT_MACHINE
from rigtwin.console import table
from rigtwin.description.configuration import parameters
from rigtwin.studies.tuning.evaluation import Change, Comparison, Spread
from rigtwin.studies.tuning.result import TUNED_NOMINAL, TuningResult, settings_of
from rigtwin.studies.tuning.scenario import NOMINAL
from rigtwin.studies.tuning.study import Constraint, Study

CLOSE = 0.02
"""Share of a bound within which a figure counts as at it: the search goes to the bound, and other
roads are other roads."""
HEADER = (
    *("measure", "unit", "before", "5 to 95 %", "after", "5 to 95 %"),
    *("change", "95 % of the median", "no worse in"),
)


def number(value: float) -> str:
    """Four significant digits."""
    return f"{value:.4g}"


def percent(share: float) -> str:
    """Whole percents of a share."""
    return f"{100.0 * share:.0f} %"


def spread(of: Spread) -> tuple[str, str]:
    """The median, and where most are."""
    return number(of.median), f"{number(of.low)} to {number(of.high)}"


def change(of: Change) -> tuple[str, str]:
    """The change of the median, and its interval."""
    unit = " %" if of.relative else ""
    interval = "too few for an interval"
    if math.isfinite(of.low):
        interval = f"{of.low:+.3g} to {of.high:+.3g}{unit}"
    return f"{of.median:+.3g}{unit}", interval


def change_in_words(of: Change) -> str:
    """The measure, its change and the interval of that."""
    median, interval = change(of)
    return f"{of.measure.title} {median} [{interval}]"


def row(of: Change) -> tuple[str, ...]:
    """The cells under HEADER."""
    spreads = (*spread(of.before), *spread(of.after))
    return of.measure.title, of.measure.unit, *spreads, *change(of), percent(of.better)


def heading(of: Comparison) -> str:
    """What is compared, where."""
    return f"{of.settings} against {of.against}, {of.rig}, {of.runs} held-out scenarios"


def remarks(of: Comparison) -> list[str]:
    """What is besides figures: trips, and how near to the limits it came."""
    before, after = map(percent, of.trips)
    lines = [f"at most {percent(of.limits)} of a safety limit"]
    if max(of.trips) > 0.0:
        lines.append(f"tripped: {after} of the runs, {before} before; those are not compared")
    return lines


def sentence(result: TuningResult) -> str:
    """The answer in one sentence."""
    main, goals = result.main, result.study.goals
    if not main.changes:
        tripped = f"Every held-out run of one of the two tripped on the {result.rig}"
        return f"{tripped}: nothing can be compared."
    gained = " and ".join(change_in_words(main.of(measure.name)) for measure in goals.minimise)
    held = [constraint_in_words(main, constraint) for constraint in goals.constraints]
    beside = f", with {', '.join(held)}" if held else ""
    return f"On {main.runs} held-out scenarios {gained}{beside}."


def constraint_in_words(comparison: Comparison, constraint: Constraint) -> str:
    """A constraint on held-out scenarios: the change, or the figure beside its bound."""
    each = comparison.of(constraint.measure.name)
    if not math.isnan(constraint.share):
        return change_in_words(each)
    bound = f"{'at least' if each.measure.more else 'at most'} {number(constraint.bound)}"
    return f"{each.measure.title} {number(each.quantile)} {each.measure.unit} ({bound})"


def concerns(result: TuningResult) -> list[str]:
    """What speaks against the settings, on every rig that they are evaluated on."""
    main, goals = result.main, result.study.goals
    lines = []
    for each in result.comparisons:
        if each.against != main.against:
            continue
        before, after = each.trips
        if after > before:
            lines.append(f"{each.rig}: {percent(after)} of the runs trip, {percent(before)} before")
        elif each.limits > goals.limits:
            reached, allowed = percent(each.limits), percent(goals.limits)
            lines.append(f"{each.rig}: {reached} of a safety limit, {allowed} allowed")
        if each.changes:
            said = [_violation(each, constraint) for constraint in goals.constraints]
            lines += [f"{each.rig}: {one}" for one in said if one]
    if not (main.changes and any(main.of(measure.name).improved for measure in goals.minimise)):
        lines.append(f"no objective is certainly better than {main.against}")
    return lines


def _violation(comparison: Comparison, constraint: Constraint) -> str | None:
    each = comparison.of(constraint.measure.name)
    more, title = each.measure.more, each.measure.title
    if math.isnan(constraint.share):
        bound = constraint.bound
        if (bound - each.quantile if more else each.quantile - bound) <= CLOSE * abs(bound):
            return None
        return f"{title} is {number(each.quantile)} {each.measure.unit}, bound {number(bound)}"
    # In %, or in the unit, of what the baseline has in the same scenario.
    usual = 100.0 if each.relative else each.before.median
    allowed = usual * (constraint.share - 1.0)
    beyond = allowed - each.high if more else each.low - allowed
    slack = 0.0 if each.relative else CLOSE * abs(each.before.median)
    return f"{title} is certainly beyond its bound: {change(each)[1]}" if beyond > slack else None


def notes(result: TuningResult) -> list[str]:
    """What should be known besides."""
    study, before = result.study, result.study.baseline_settings
    lines = []
    for parameter in study.parameters:
        there = getattr(before, parameter.name)
        if not parameter.low <= there <= parameter.high:
            bounds = f"outside the bounds {number(parameter.low)} to {number(parameter.high)}"
            told = f"{parameter.key} is {number(there)} before, {bounds}"
            lines.append(f"{told}: the search began at the bound")
    if result.alike:
        told = f"{study.experiment.name} is the same test whatever its seed"
        lines.append(f"{told}: only noise differs between these scenarios")
    return lines


def alternatives(result: TuningResult) -> list[str]:
    """What the diagnosis is worth if it is right, and what the settings lose if it is wrong."""
    lines = []
    for each in result.comparisons:
        if each.against != TUNED_NOMINAL or not each.changes:
            continue
        which = f"on the {each.rig}"
        if each.rig == NOMINAL.name:
            which = "if the diagnosis were wrong and the rig nominal"
        first = change_in_words(each.of(result.study.goals.minimise[0].name))
        lines.append(f"{which}: {first} against settings {TUNED_NOMINAL}")
    return lines


def values(result: TuningResult) -> list[tuple[str, ...]]:
    """Every parameter: before, after, bounds, unit."""
    before = result.study.baseline_settings
    rows = [("parameter", "before", "after", "between", "unit")]
    for parameter, value in zip(result.study.parameters, result.chosen.values, strict=True):
        there = number(getattr(before, parameter.name))
        at_end = " (at its bound)" if value in (parameter.low, parameter.high) else ""
        bounds = f"{number(parameter.low)} to {number(parameter.high)}"
        rows.append((parameter.key, there, number(value) + at_end, bounds, parameter.unit))
    return rows


def text(result: TuningResult) -> str:
    """Everything as plain text."""
    beside = [*(f"but {line}" for line in concerns(result)), *notes(result)]
    head = "\n".join([result.study.title, sentence(result), *beside])
    blocks = [head, table(values(result))]
    for each in (*result.comparisons, *result.front_comparisons):
        found = table([HEADER, *map(row, each.changes)]) if each.changes else "nothing to compare"
        blocks.append("\n".join([heading(each), found, *remarks(each)]))
    if lines := alternatives(result):
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def command(study: Study, settings: object) -> str:
    """The line that runs a study's experiment with settings of a file."""
    shipped = study.machine.name == DEFAULT_MACHINE
    other = "" if shipped else f" --machine {study.machine.path}"
    return f"rigtwin run {study.experiment.name}{other} --config {settings}"


def toml(result: TuningResult, point: int | None = None) -> str:
    """The settings as `run --config` takes them: those that differ from the experiment's own.

    point: which of the front; the chosen one unless said.
    """
    study = result.study
    candidate = result.chosen if point is None else result.front[point]
    comparison = result.main if point is None else result.front_comparisons[point]
    where = f"tuned on the {result.rig}, seed {result.seed}, {study.budget.roads} scenarios"
    lines = [f"# {study.title}", f"# {where}"]
    for each in comparison.changes:
        median, interval = change(each)
        lines.append(f"# {each.measure.title}: {median} [{interval}] held out")
    lines += [f"# but {line}" for line in (concerns(result) if point is None else ())]
    lines += [f"# {command(study, 'THIS.toml')}", "", "[controller]"]
    before = {key: value for key, value, _ in parameters(study.experiment.configuration)}
    for name, value in settings_of(study, candidate)._asdict().items():
        if value != before[f"controller.{name}"]:
            said = f'"{value.label}"' if hasattr(value, "label") else repr(value)
            lines.append(f"{name} = {said}")
    return "\n".join(lines) + "\n"
