"""What is claimed: effects with their magnitudes, how sure that is, and what these data cannot tell
from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rigtwin.components import Effect, find, title
from rigtwin.diagnosis.attribute import Attribution, Explanation
from rigtwin.diagnosis.controller import Deviation
from rigtwin.diagnosis.cross_validation import Validation
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Estimate, Finding, Name, Nearest, Unobservable
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.sampling import SensorProperty
from rigtwin.diagnosis.text import tell_apart
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

SHOWN = 0.01
"""Share of what is left that traces must gain to be mentioned."""


def describe_attributed(
    found: Attribution, outcome: Validation, evidence: Evidence, thresholds: Thresholds
) -> list[Finding]:
    """The effects of the explanation that is named.

    Parameters
    ----------
    found
        What was tried, and the explanation to be named.
    outcome
        What data held out of its fit say of it.
    evidence
        That it was fitted to.
    thresholds
        What figures are held against.

    Returns
    -------
    list of Finding
        Those that stay, none if nothing is named.
    """
    if found.best is None:
        return []
    fit = outcome.fit or found.best.fit
    widths = [
        tuple(
            # A rough model's error is no noise: how far it leads astray shows between one half of
            # the data and the other.
            max(width, abs(one - other) / thresholds.wider) if evidence.machine.rough else width
            for width, one, other in zip(
                own, *(half.values[number] for half in outcome.halves), strict=True
            )
        )
        if len(outcome.halves) == 2
        else own
        for number, own in enumerate(fit.widths)
    ]
    if (selection := found.selection) is not None:
        widths = [
            tuple(
                max(width, half / thresholds.wider)
                for width, half in zip(own, selection.half_widths(effect), strict=True)
            )
            for effect, own in zip(fit.effects, widths, strict=True)
        ]
    surest = (
        thresholds.sure if len(fit.effects) == 1 and not found.unknown else thresholds.less_sure
    )
    supports = (
        {} if selection is None else {effect: selection.support(effect) for effect in fit.effects}
    )

    def confidence(effect: Effect) -> float:
        if effect in supports:
            support = supports[effect]
            return thresholds.selection.confidence(support.margin, support.left)
        return min(surest, _probability(found.ranking, effect))

    return [
        Finding(
            name=Name(effect.component, effect.kind.name),
            parameters=estimates(effect, values, spread, evidence, thresholds.wider),
            confidence=confidence(effect),
            alternatives=_equivalence_class(found.ranking, found.best, effect, thresholds.member),
            share=min(max(found.shares.get(effect.name, found.explained), 0.0), 1.0),
            title=effect.kind.title,
            support=supports.get(effect),
        )
        for effect, values, spread in zip(fit.effects, fit.values, widths, strict=True)
        if effect in outcome.kept
    ]


def find_traces(
    found: Attribution, evidence: Evidence, thresholds: Thresholds
) -> tuple[Finding, ...]:
    """Of a rough model, the effects that the best explanation of all has beside those that are
    named: what it gains by them is too little to claim them."""
    if found.selection is None or found.best is None:
        return ()
    chosen, best = found.selection.chosen, found.selection.pool[0]
    gained = max(1.0 - math.exp(2.0 * (best.score - chosen.score)), 0.0)
    more = [
        effect
        for effect, values in zip(best.fit.effects, best.fit.values, strict=True)
        if effect not in chosen.fit.effects
        and values[0] != effect.nominal(evidence.plant)[effect.kind.parameters[0]]
    ]
    if gained < SHOWN:
        return ()
    return tuple(
        Finding(
            Name(effect.component, effect.kind.name),
            estimates(effect, values, widths, evidence, thresholds.wider),
            0.0,
            (Name(effect.component, effect.kind.name),),
            gained / len(more),
            effect.kind.title,
        )
        for effect, values, widths in zip(
            best.fit.effects, best.fit.values, best.fit.widths, strict=True
        )
        if effect in more
    )


def find_nearest(found: Attribution) -> Nearest | None:
    """What comes nearest to something that has no name.

    Parameters
    ----------
    found
        Everything that was tried.

    Returns
    -------
    Nearest or None
        The best explanation, with what it leaves; None if none was tried.
    """
    if found.selection is not None:
        empty = next(each for each in found.selection.pool if not each.fit.effects)
        tried = [each for each in found.selection.pool if each.fit.effects and not each.bounded]
        if not tried:
            return None
        price = found.selection.price
        best = min(tried, key=lambda each: each.score + price * each.size)
        return Nearest(_names(best.fit), math.exp(best.score), math.exp(empty.score), "signals")
    explained = [each.fit for each in found.ranking if each.fit.effects]
    if not explained:
        return None
    left, without = (
        math.sqrt(fit.misfit / found.expected) for fit in (explained[0], found.nothing)
    )
    return Nearest(_names(explained[0]), left, without, "noise")


def _names(fit: Fit) -> tuple[Name, ...]:
    return tuple(Name(effect.component, effect.kind.name) for effect in fit.effects)


def estimates(
    effect: Effect,
    values: Sequence[float],
    widths: Sequence[float],
    evidence: Evidence,
    wider: float = STANDARD.wider,
) -> dict[str, Estimate]:
    """The parameters of an effect as fitted, with their intervals.

    Parameters
    ----------
    effect
        That was fitted.
    values, widths
        Of its parameters, and their standard deviations.
    evidence
        That it was fitted to.
    wider
        Standard deviations to either side.

    Returns
    -------
    dict
        Parameter → estimate, of those that the recordings show anything of.
    """
    nominal = effect.nominal(evidence.plant)
    # A delay cannot be known better than when in a tick the samples were taken.
    timing = max((evidence.width(t) for t in evidence.machine.tolerances if t.ticks), default=0.0)
    least = {"delay": timing / wider}
    return {
        name: Estimate(
            value,
            max(value - wider * max(width, least.get(name, 0.0)), quantity.low),
            min(value + wider * max(width, least.get(name, 0.0)), quantity.high),
            nominal[name],
            evidence.machine.unit(effect.group, quantity),
        )
        for (name, quantity), value, width in zip(
            effect.quantities().items(), values, widths, strict=True
        )
        # A place along an axis that no motion here shows was never fitted, and is not known.
        if width > 0.0 or name == effect.kind.parameters[0]
    }


def _probability(ranking: Sequence[Explanation], effect: Effect) -> float:
    return float(sum(each.probability for each in ranking if effect in each.fit.effects))


def _equivalence_class(
    ranking: Sequence[Explanation], best: Explanation, effect: Effect, least: float
) -> tuple[Name, ...]:
    """Effects that stand in this one's place in other likely explanations."""
    names = [Name(effect.component, effect.kind.name)]
    rest = [other for other in best.fit.effects if other != effect]
    for each in ranking:
        if (
            each.probability < least
            or len(each.fit.effects) != len(best.fit.effects)
            or effect in each.fit.effects
        ):
            continue
        for other in each.fit.effects:
            if other not in rest and len([e for e in each.fit.effects if e in rest]) == len(rest):
                names.append(Name(other.component, other.kind.name))
    return tuple(dict.fromkeys(names))


def describe_sensor(each: SensorProperty, evidence: Evidence, sure: float) -> Finding:
    """A property that was read off a sensor's own signal."""
    effect = find(f"{each.kind}@{each.component}", evidence.plant)
    unit = evidence.machine.unit(effect.group, effect.quantities()[each.parameter])
    spread = 0.05 * each.value
    estimate = Estimate(each.value, each.value - spread, each.value + spread, each.nominal, unit)
    name = Name(each.component, each.kind)
    return Finding(name, {each.parameter: estimate}, sure, (name,), 1.0, effect.kind.title)


def describe_controller(each: Deviation, sure: float) -> Finding:
    """Something that the controller did other than told."""
    name = Name("controller", each.kind)
    spread = 1e-3 * abs(each.used)
    estimate = Estimate(each.used, each.used - spread, each.used + spread, each.told, each.unit)
    return Finding(name, {each.name: estimate}, sure, (name,), 1.0, title(each.kind))


def describe_slight(each: Deviation) -> str:
    """What the controller did other than told, if nothing comes of it."""
    share = f"{100 * each.consequence:.1g} %"
    if each.kind == "unknown":
        return f"the controller's commands differ by {share} from those of its settings; no gap"
    used, told = tell_apart(each.used, each.told)
    unit = "" if each.unit == "1" else f" {each.unit}"
    return (
        f"the controller's {each.name} is {used}{unit} instead of {told}{unit}, "
        f"which changes no command by more than {share}; no gap"
    )


def list_unobservable(found: Attribution, effects: Sequence[Finding]) -> tuple[Unobservable, ...]:
    """Effects that these data could not show, whatever their size."""
    why = "no size tried changes these data by more than their noise"
    named = {(effect.name.component, effect.name.kind) for effect in effects}
    unseen = [Unobservable(effect.component, effect.kind.name, why) for effect in found.silent]
    return tuple(each for each in unseen if (each.component, each.kind) not in named)
