"""What came out of a study, in words and tables; on a terminal and on its page."""

from __future__ import annotations

import math

from rigtwin.console import table
from rigtwin.machine.configuration import parameters
from rigtwin.studies.tuning.judged import Change, Comparison, Spread
from rigtwin.studies.tuning.outcome import NOMINAL, TUNED_NOMINAL, Outcome
from rigtwin.studies.tuning.study import Constraint

CLOSE = 0.02
"""Share of a bound within which a figure counts as at it: the search goes to the bound, and other roads are other roads."""
HEADER = ("measure", "unit", "before", "5 to 95 %", "after", "5 to 95 %", "change", "95 % of the median", "no worse in")


def number(value: float) -> str:
    return f"{value:.4g}"


def spread(of: Spread) -> tuple[str, str]:
    return number(of.median), f"{number(of.low)} to {number(of.high)}"


def change(of: Change) -> tuple[str, str]:
    """The change of the median, and its interval."""
    unit = " %" if of.relative else ""
    interval = f"{of.low:+.3g} to {of.high:+.3g}{unit}" if math.isfinite(of.low) else "too few for an interval"
    return f"{of.median:+.3g}{unit}", interval


def row(of: Change) -> tuple[str, ...]:
    better = f"{100.0 * of.better:.0f} %"
    return of.measure.title, of.measure.unit, *spread(of.before), *spread(of.after), *change(of), better


def heading(of: Comparison) -> str:
    """What is compared, where."""
    return f"{of.settings} against {of.against}, {of.rig}, {of.runs} held-out scenarios"


def remarks(of: Comparison) -> list[str]:
    """What is besides figures: trips, and how near to the limits it came."""
    before, after = (f"{100.0 * share:.0f} %" for share in of.trips)
    lines = [f"at most {100.0 * of.limits:.0f} % of a safety limit"]
    if max(of.trips) > 0.0:
        lines.append(f"tripped: {after} of the runs, {before} before; those are not compared")
    return lines


def sentence(outcome: Outcome) -> str:
    """The answer in one sentence."""
    if not outcome.found.changes:
        return f"Every held-out run of one of the two tripped on the {outcome.rig}: nothing can be compared."
    objectives = [outcome.found.of(measure.name) for measure in outcome.study.minimise]
    gained = " and ".join(f"{each.measure.title} {change(each)[0]} [{change(each)[1]}]" for each in objectives)
    held = [kept(outcome, constraint) for constraint in outcome.study.constraints]
    beside = f", with {', '.join(held)}" if held else ""
    return f"On {outcome.found.runs} held-out scenarios {gained}{beside}."


def kept(outcome: Outcome, constraint: Constraint) -> str:
    """What became of a constraint on held-out scenarios: the change against the baseline, or the figure beside its bound."""
    each = outcome.found.of(constraint.measure.name)
    if not math.isnan(constraint.share):
        return f"{each.measure.title} {change(each)[0]} [{change(each)[1]}]"
    bound = f"{'at least' if each.measure.more else 'at most'} {number(constraint.bound)}"
    return f"{each.measure.title} {number(each.worth)} {each.measure.unit} ({bound})"


def concerns(outcome: Outcome) -> list[str]:
    """What speaks against the settings as they are: on the rig that they were tuned on, and on those they are judged on."""
    found = outcome.found
    lines = []
    for each in (found, *(other for other in outcome.comparisons if other is not found and other.against == found.against)):
        before, after = each.trips
        if after > before:
            lines.append(f"{each.rig}: {100.0 * after:.0f} % of the runs trip, {100.0 * before:.0f} % before")
        if each.limits > outcome.study.limits and after <= before:
            reached, allowed = 100.0 * each.limits, 100.0 * outcome.study.limits
            lines.append(f"{each.rig}: {reached:.0f} % of a safety limit, {allowed:.0f} % allowed")
        if each.changes:
            said = [_violated(each, constraint) for constraint in outcome.study.constraints]
            lines += [f"{each.rig}: {one}" for one in said if one]
    improved = [found.of(measure.name).improved for measure in outcome.study.minimise] if found.changes else []
    if not any(improved):
        lines.append(f"no objective is certainly better than {found.against}")
    return lines


def _violated(comparison: Comparison, constraint: Constraint) -> str | None:
    each = comparison.of(constraint.measure.name)
    more = each.measure.more
    if math.isnan(constraint.share):
        beyond = constraint.bound - each.worth if more else each.worth - constraint.bound
        if beyond <= CLOSE * abs(constraint.bound):
            return None
        return f"{each.measure.title} is {number(each.worth)} {each.measure.unit}, bound {number(constraint.bound)}"
    # In %, or in the unit, of what the baseline has in the same scenario.
    allowed = 100.0 * (constraint.share - 1.0) if each.relative else (constraint.share - 1.0) * each.before.median
    beyond = allowed - each.high if more else each.low - allowed
    slack = 0.0 if each.relative else CLOSE * abs(each.before.median)
    return f"{each.measure.title} is certainly beyond its bound: {change(each)[1]}" if beyond > slack else None


def notes(outcome: Outcome) -> list[str]:
    """What should be known besides."""
    study, before = outcome.study, outcome.study.reference
    lines = []
    for parameter in study.parameters:
        there = getattr(before, parameter.key.partition(".")[2])
        if not parameter.low <= there <= parameter.high:
            ends = f"{number(parameter.low)} to {number(parameter.high)}"
            lines.append(f"{parameter.key} is {number(there)} before, outside the bounds {ends}: the search began at the bound")
    if outcome.alike:
        lines.append(f"{study.experiment} is the same test whatever its seed: only noise differs between these scenarios")
    return lines


def wrong(outcome: Outcome) -> list[str]:
    """What the diagnosis is worth if it is right, and what the settings lose if it is wrong."""
    lines = []
    for comparison in outcome.comparisons:
        if comparison.against != TUNED_NOMINAL or not comparison.changes:
            continue
        each = comparison.of(outcome.study.minimise[0].name)
        which = "if the diagnosis were wrong and the rig nominal" if comparison.rig == NOMINAL else f"on the {comparison.rig}"
        middle, ends = change(each)
        lines.append(f"{which}: {each.measure.title} {middle} [{ends}] against settings {TUNED_NOMINAL}")
    return lines


def values(outcome: Outcome) -> list[tuple[str, ...]]:
    """Every parameter: before, after, bounds, unit."""
    before = outcome.study.reference
    rows = [("parameter", "before", "after", "between", "unit")]
    for parameter, value in zip(outcome.study.parameters, outcome.chosen.values, strict=True):
        there = getattr(before, parameter.key.partition(".")[2])
        at_end = " (at its bound)" if value in (parameter.low, parameter.high) else ""
        bounds = f"{number(parameter.low)} to {number(parameter.high)}"
        rows.append((parameter.key, number(there), number(value) + at_end, bounds, parameter.unit))
    return rows


def text(outcome: Outcome) -> str:
    """Everything as plain text."""
    beside = [*(f"but {line}" for line in concerns(outcome)), *notes(outcome)]
    blocks = ["\n".join([outcome.study.title, sentence(outcome), *beside]), table(values(outcome))]
    for comparison in (*outcome.comparisons, *outcome.on_front):
        lines = [
            heading(comparison),
            table([HEADER, *map(row, comparison.changes)]) if comparison.changes else "nothing to compare",
        ]
        blocks.append("\n".join([*lines, *remarks(comparison)]))
    if found := wrong(outcome):
        blocks.append("\n".join(found))
    return "\n\n".join(blocks)


def toml(outcome: Outcome, number_of_point: int | None = None) -> str:
    """The settings as `run --config` takes them: all of the controller's that differ from the experiment's own."""
    import experiments
    from rigtwin.studies.tuning.outcome import settings_of

    study = outcome.study
    candidate = outcome.chosen if number_of_point is None else outcome.front[number_of_point]
    comparison = outcome.found if number_of_point is None else outcome.on_front[number_of_point]
    own = experiments.find(study.experiment).configuration
    lines = [f"# {study.title}", f"# tuned on the {outcome.rig}, seed {outcome.seed}, {study.roads} scenarios"]
    lines += [f"# {each.measure.title}: {change(each)[0]} [{change(each)[1]}] held out" for each in comparison.changes]
    lines += [f"# but {line}" for line in (concerns(outcome) if number_of_point is None else ())]
    lines += [f"# rigtwin run {study.experiment} --config THIS.toml", "", "[controller]"]
    before = {key: value for key, value, _ in parameters(own) if key.startswith("controller.")}
    for name, value in settings_of(study, candidate)._asdict().items():
        if value != before[f"controller.{name}"]:
            lines.append(f'{name} = "{value.label}"' if hasattr(value, "label") else f"{name} = {value!r}")
    return "\n".join(lines) + "\n"
