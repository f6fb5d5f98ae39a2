"""Findings of a diagnosis: effects with their values, intervals, confidence and rivals."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.components import Effect
from rigtwin.components.effect import Points
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.confidence import support_of
from rigtwin.diagnosis.cross_validation import with_effects
from rigtwin.diagnosis.estimates import estimates, is_timing, standard_errors
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Estimate, Finding, Rival
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.diagnosis.traces import name_effect


def measure_support(
    explanation: Explanation, evidence: Evidence, thresholds: Thresholds
) -> dict[Effect, Support]:
    """Measure the support of each effect of the best hypothesis.

    Parameters
    ----------
    explanation
        Result of the search.
    evidence
        Recordings that were fitted.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    dict
        Effect → its support.
    """
    return {
        effect: support_of(effect, explanation.posterior, evidence, thresholds)
        for effect in explanation.fit.effects
    }


def choose_named(
    explanation: Explanation,
    support: dict[Effect, Support],
    evidence: Evidence,
    thresholds: Thresholds,
) -> tuple[Effect, ...]:
    """Choose the effects of the best hypothesis that are named.

    An effect is named if the probability that it or one of its rivals is present is at least
    `Thresholds.naming_confidence`. The rivals count together, because the finding lists them all.
    An effect with too many rivals is not named: the finding would say little.

    Parameters
    ----------
    explanation
        Result of the search.
    support
        Support of each effect of the best hypothesis.
    evidence
        Recordings that were fitted.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    tuple of Effect
        Named effects, in the order of the fit.
    """
    posterior, named = explanation.posterior, []
    for effect, values, widths in zip(
        explanation.fit.effects,
        explanation.fit.values,
        standard_errors(explanation, support, thresholds),
        strict=True,
    ):
        # Standard errors with all their parts are used, also those of residual and hypotheses, as
        # the answer shows them.
        steadiness = effect.steadiness(values, widths, posterior.nominal)
        if steadiness <= thresholds.interval_half_width or is_timing(effect, values, evidence):
            # The interval holds the nominal value, so the data do not ask for a change.
            continue
        shares = [
            posterior.inclusion(candidate) for candidate in (effect, *posterior.rivals(effect))
        ]
        # A hypothesis with two of the rivals counts twice in the sum, which may therefore exceed 1.
        probability = min(sum(shares), 1.0) * (1.0 - support[effect].mimic)
        # Effective number of rivals (inverse participation ratio): n for n equal shares.
        members = sum(shares) ** 2 / sum(share**2 for share in shares)
        if probability >= thresholds.naming_confidence and members <= thresholds.rival_count:
            named.append(effect)
    return tuple(named)


def describe_attributed(
    explanation: Explanation,
    named: Sequence[Effect],
    support: dict[Effect, Support],
    evidence: Evidence,
    thresholds: Thresholds,
) -> list[Finding]:
    """Describe the effects that are named.

    Parameters
    ----------
    explanation
        Result of the search.
    named
        Effects that are named.
    support
        Support of each effect of the best hypothesis.
    evidence
        Recordings that were fitted.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    list of Finding
        Findings in the order of the fit.
    """
    posterior, fit = explanation.posterior, explanation.fit
    shares = _shares(fit, named, evidence, posterior)
    most = (
        thresholds.unfinished_confidence
        if explanation.ended_early
        else thresholds.highest_confidence
    )
    findings = []
    all_widths = standard_errors(explanation, support, thresholds)
    for effect, values, widths in zip(fit.effects, fit.values, all_widths, strict=True):
        if effect not in named:
            continue
        rivals = posterior.rivals(effect)
        findings.append(
            Finding(
                name=name_effect(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=min(support[effect].confidence, most),
                alternatives=tuple(name_effect(candidate) for candidate in (effect, *rivals)),
                share=shares[effect],
                title=effect.kind.title,
                support=support[effect],
                rivals=tuple(
                    _describe_rival(rival, effect, explanation, evidence) for rival in rivals
                ),
                curve=_points(effect, values),
            )
        )
    return findings


def _points(effect: Effect, values: Sequence[float]) -> Points:
    points = effect.kind.points
    return () if points is None else points(dict(zip(effect.kind.parameters, values, strict=True)))


def _describe_rival(
    rival: Effect, effect: Effect, explanation: Explanation, evidence: Evidence
) -> Rival:
    """Describe a rival with its values in the best hypothesis that has it instead of an effect."""
    best, probability = explanation.posterior.best, explanation.posterior.inclusion(rival)
    rest = set(explanation.fit.effects) - {effect}
    for hypothesis in explanation.posterior.ranking:
        scored = hypothesis.scored
        # The ranking is sorted by cost, so the first hypothesis that fits the description is the
        # best one.
        if rival in scored.fit.effects and rest <= set(scored.fit.effects):
            beside = []
            for member in scored.fit.effects:
                with_rival = _estimates_in(scored, member, evidence)
                if member in rest and _differ(with_rival, _estimates_in(best, member, evidence)):
                    beside.append((name_effect(member), with_rival))
            values = _estimates_in(scored, rival, evidence)
            return Rival(name_effect(rival), values, probability, tuple(beside))
    return Rival(name_effect(rival), {}, probability)


def _estimates_in(scored: Scored, effect: Effect, evidence: Evidence) -> dict[str, Estimate]:
    number = scored.fit.effects.index(effect)
    return estimates(effect, scored.fit.values[number], scored.widths[number], evidence)


def _differ(first: dict[str, Estimate], second: dict[str, Estimate]) -> bool:
    """Return whether the intervals of two estimates of one effect have nothing in common."""
    return any(
        first[name].low > second[name].high or first[name].high < second[name].low
        for name in first.keys() & second.keys()
    )


def _shares(
    fit: Fit, named: Sequence[Effect], evidence: Evidence, posterior: HypothesisPosterior
) -> dict[Effect, float]:
    """Split the explained share of the gap's power among effects.

    The parts are proportional to the misfit that returns when each effect alone is left out.
    """
    # `closes` is a share of the gap's amplitude, and findings have shares of its power.
    explained = min(max(1.0 - (1.0 - posterior.closes(posterior.best)) ** 2, 0.0), 1.0)
    if len(named) <= 1:
        return dict.fromkeys(named, explained)

    def misfit(effects: Sequence[Effect]) -> float:
        plant: Plant = with_effects(evidence.plant, fit, effects)
        return float((evidence.residual(plant) ** 2).sum())

    whole = misfit(named)
    # A share is negative where leaving an effect out happens to fit better; it counts as zero.
    returned = [
        max(misfit([other for other in named if other != effect]) - whole, 0.0) for effect in named
    ]
    total = max(sum(returned), 1e-9)
    return {
        effect: explained * misfit_alone / total
        for effect, misfit_alone in zip(named, returned, strict=True)
    }
