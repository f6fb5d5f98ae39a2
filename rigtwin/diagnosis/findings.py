"""What is claimed: effects with their magnitudes, how sure that is, and what these data cannot tell
from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rigtwin.components import Effect, find, title
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.confidence import support_of
from rigtwin.diagnosis.controller import Deviation
from rigtwin.diagnosis.cross_validation import with_effects
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Estimate, Finding, Name, Nearest, Rival, Unobservable
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.sampling import SensorProperty
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.text import tell_apart
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

WIDEST = 0.9
"""Share of the distance to the nominal value that an interval widened by the rest may span."""
SHOWN = 1e-3
"""Weight from which a hypothesis with one more effect makes that effect a trace."""


def supports(
    found: Explanation, evidence: Evidence, thresholds: Thresholds
) -> dict[Effect, Support]:
    """What speaks for each effect of the best hypothesis.

    Parameters
    ----------
    found
        Everything that was tried.
    evidence
        The recordings.
    thresholds
        Numbers that it goes by.

    Returns
    -------
    dict
        Effect → its support.
    """
    return {
        effect: support_of(effect, found.posterior, evidence, thresholds)
        for effect in found.fit.effects
    }


def choose_named(
    found: Explanation, support: dict[Effect, Support], thresholds: Thresholds
) -> tuple[Effect, ...]:
    """Choose the effects of the best hypothesis that are named.

    An effect is named where it, or one that the data cannot tell from it, is more likely there than
    not. All of its rivals take its place together, unless they are so many that the finding says
    little of what is there.
    """
    posterior, named = found.posterior, []
    for effect, values, widths in zip(
        found.fit.effects, found.fit.values, _widths(found, support, thresholds), strict=True
    ):
        nominal = effect.nominal(posterior.nominal)[effect.kind.parameters[0]]
        if abs(values[0] - nominal) <= thresholds.interval_half_width * widths[0]:
            # An interval that holds the nominal value is no finding.
            continue
        shares = [posterior.inclusion(each) for each in (effect, *posterior.rivals(effect))]
        chance = min(sum(shares), 1.0) * (1.0 - support[effect].mimic)
        members = sum(shares) ** 2 / sum(share**2 for share in shares)
        if chance >= thresholds.naming_confidence and members <= thresholds.rival_count:
            named.append(effect)
    return tuple(named)


def describe_attributed(
    found: Explanation,
    kept: Sequence[Effect],
    support: dict[Effect, Support],
    evidence: Evidence,
    thresholds: Thresholds,
) -> list[Finding]:
    """Describe the effects that are named.

    Parameters
    ----------
    found
        Everything that was tried.
    kept
        Effects that are named.
    support
        What speaks for each of them.
    evidence
        The recordings.
    thresholds
        Numbers that it goes by.

    Returns
    -------
    list of Finding
        In the order of the fit.
    """
    posterior, fit = found.posterior, found.fit
    shares = _shares(fit, kept, evidence, posterior)
    findings = []
    all_widths = _widths(found, support, thresholds)
    for effect, values, widths in zip(fit.effects, fit.values, all_widths, strict=True):
        if effect not in kept:
            continue
        rivals = posterior.rivals(effect)
        findings.append(
            Finding(
                name=_name(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=min(support[effect].confidence, thresholds.highest_confidence),
                alternatives=tuple(_name(each) for each in (effect, *rivals)),
                share=shares[effect],
                title=effect.kind.title,
                support=support[effect],
                rivals=tuple(_describe_rival(each, effect, found, evidence) for each in rivals),
            )
        )
    return findings


def _describe_rival(rival: Effect, effect: Effect, found: Explanation, evidence: Evidence) -> Rival:
    """A rival with the values that it has in the effect's place."""
    rest = set(found.fit.effects) - {effect}
    for each in found.posterior.ranking:
        fit = each.scored.fit
        if rival in fit.effects and rest <= set(fit.effects):
            number = fit.effects.index(rival)
            widths = each.scored.widths[number]
            values = estimates(rival, fit.values[number], widths, evidence)
            return Rival(_name(rival), values, found.posterior.inclusion(rival))
    return Rival(_name(rival), {}, found.posterior.inclusion(rival))


def _widths(
    found: Explanation, support: dict[Effect, Support], thresholds: Thresholds
) -> list[tuple[float, ...]]:
    """Standard errors of all values.

    Each combines the larger one of cross-validation and final fit, the spread over hypotheses, and
    the shift that the rest may cause. A rest whose amplitude is 1/d of an effect's own shifts its
    magnitude by 1/d times the correlation of both, of which only the usual size is known. That
    shift does not make an effect doubtful: `Support.mimic` says how likely the rest has been taken
    for it.
    """
    posterior, widths = found.posterior, []
    for effect, values, scored, fitted in zip(
        found.fit.effects,
        found.fit.values,
        posterior.best.widths,
        found.fit.widths,
        strict=True,
    ):
        nominal = effect.nominal(posterior.nominal)[effect.kind.parameters[0]]
        parts = zip(scored, fitted, posterior.spread(effect), strict=True)
        own = [math.hypot(max(one, other), spread) for one, other, spread in parts]
        off = abs(values[0] - nominal)
        shift = thresholds.rest_correlation / support[effect].dominance * off
        most = max(own[0], WIDEST * off / thresholds.interval_half_width)
        widths.append((min(math.hypot(own[0], shift), most), *own[1:]))
    return widths


def _shares(
    fit: Fit, kept: Sequence[Effect], evidence: Evidence, posterior: HypothesisPosterior
) -> dict[Effect, float]:
    """Share of the gap of each effect: what would come back without it, of what would for all."""
    explained = min(max(1.0 - (1.0 - posterior.closes(posterior.best)) ** 2, 0.0), 1.0)
    if len(kept) <= 1:
        return dict.fromkeys(kept, explained)

    def misfit(effects: Sequence[Effect]) -> float:
        plant: Plant = with_effects(evidence.plant, fit, effects)
        return float((evidence.residual(plant) ** 2).sum())

    whole = misfit(kept)
    lost = [
        max(misfit([other for other in kept if other != effect]) - whole, 0.0) for effect in kept
    ]
    total = max(sum(lost), 1e-9)
    return {effect: explained * one / total for effect, one in zip(kept, lost, strict=True)}


def find_traces(
    found: Explanation, kept: Sequence[Effect], evidence: Evidence, thresholds: Thresholds
) -> tuple[Finding, ...]:
    """Effects that may be there beside those that are named, but are not sure enough to be named.

    Parameters
    ----------
    found
        Everything that was tried.
    kept
        Effects that are named.
    evidence
        The recordings.
    thresholds
        Numbers that it goes by.

    Returns
    -------
    tuple of Finding
        Effects of the likeliest larger hypothesis, none if there is none.
    """
    named = set(kept)
    for each in found.posterior.ranking:
        scored, effects = each.scored, set(each.scored.fit.effects)
        if each.weight < SHOWN or not named < effects:
            continue
        more = [effect for effect in scored.fit.effects if effect not in named]
        gained = found.posterior.closes(scored) - found.posterior.closes(found.posterior.best)
        return tuple(
            Finding(
                name=_name(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=found.posterior.inclusion(effect),
                alternatives=(_name(effect),),
                share=max(gained, 0.0) / len(more),
                title=effect.kind.title,
            )
            for effect, values, widths in zip(
                scored.fit.effects, scored.fit.values, scored.widths, strict=True
            )
            if effect in more
        )
    return ()


def find_nearest(found: Explanation, evidence: Evidence) -> Nearest | None:
    """Find the explanation that comes nearest to something that has no name.

    Parameters
    ----------
    found
        Everything that was tried.
    evidence
        The recordings.

    Returns
    -------
    Nearest or None
        The best hypothesis with any effect, and what it leaves; None if none was tried.
    """
    tried = [each.scored.fit for each in found.posterior.ranking if each.scored.fit.effects]
    if not tried:
        return None
    left, without = (
        float((relative_errors(evidence, plant) ** 2).mean() ** 0.5)
        for plant in (tried[0].plant, evidence.plant)
    )
    return Nearest(tuple(_name(effect) for effect in tried[0].effects), left, without)


def _name(effect: Effect) -> Name:
    return Name(effect.component, effect.kind.name)


def estimates(
    effect: Effect,
    values: Sequence[float],
    widths: Sequence[float],
    evidence: Evidence,
    wider: float = STANDARD.interval_half_width,
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


def list_unobservable(found: Explanation, effects: Sequence[Finding]) -> tuple[Unobservable, ...]:
    """List the effects that these data could not show, whatever their size."""
    why = "no size tried changes these data by more than their noise"
    named = {(effect.name.component, effect.name.kind) for effect in effects}
    unseen = [Unobservable(each.component, each.kind.name, why) for each in found.unobservable]
    return tuple(each for each in unseen if (each.component, each.kind) not in named)
