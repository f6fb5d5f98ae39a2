"""Findings of a diagnosis: effects with their values, intervals, confidence and rivals."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rigtwin.components import UNLIMITED, Effect
from rigtwin.components.effect import Points
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.confidence import support_of
from rigtwin.diagnosis.cross_validation import with_effects
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Estimate, Finding, Name, Nearest, Rival, Unobservable
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.starts import LATE_BY_TIME
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

WIDEST = 0.9
"""Upper bound on the half interval that a residual widens, as a share of the distance to nominal.

Widening alone therefore never makes an interval hold the nominal value."""
TRACE_WEIGHT = 1e-3
"""Weight from which a hypothesis with one more effect makes that effect a trace."""
TRACE_SHARE = 0.005
"""Share of the gap that the effects of a trace must close together."""


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
        _standard_errors(explanation, support, thresholds),
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


def is_timing(effect: Effect, values: Sequence[float], evidence: Evidence) -> bool:
    """Return whether an effect shifts a signal by no more than the tolerance of its sampling.

    Parameters
    ----------
    effect
        Effect that was fitted.
    values
        Values of its parameters, SI.
    evidence
        Recordings that were fitted.

    Returns
    -------
    bool
        True for a lag or delay that is no finding.
    """
    if effect.kind.name not in LATE_BY_TIME:
        return False
    (shift,) = effect.distances(values, evidence.plant)
    return shift <= _timing(evidence)


def _timing(evidence: Evidence) -> float:
    """Return the tolerance of the sampling time within a tick, s."""
    return max((evidence.width(t) for t in evidence.machine.tolerances if t.ticks), default=0.0)


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
    all_widths = _standard_errors(explanation, support, thresholds)
    for effect, values, widths in zip(fit.effects, fit.values, all_widths, strict=True):
        if effect not in named:
            continue
        rivals = posterior.rivals(effect)
        findings.append(
            Finding(
                name=_name(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=min(support[effect].confidence, most),
                alternatives=tuple(_name(candidate) for candidate in (effect, *rivals)),
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
                    beside.append((_name(member), with_rival))
            values = _estimates_in(scored, rival, evidence)
            return Rival(_name(rival), values, probability, tuple(beside))
    return Rival(_name(rival), {}, probability)


def _estimates_in(scored: Scored, effect: Effect, evidence: Evidence) -> dict[str, Estimate]:
    number = scored.fit.effects.index(effect)
    return estimates(effect, scored.fit.values[number], scored.widths[number], evidence)


def _differ(first: dict[str, Estimate], second: dict[str, Estimate]) -> bool:
    """Return whether the intervals of two estimates of one effect have nothing in common."""
    return any(
        first[name].low > second[name].high or first[name].high < second[name].low
        for name in first.keys() & second.keys()
    )


def _standard_errors(
    explanation: Explanation, support: dict[Effect, Support], thresholds: Thresholds
) -> list[tuple[float, ...]]:
    """Standard errors of all values of the best hypothesis, one tuple per effect.

    The standard error of a value is

        sqrt(max(s_cv, s_fit)^2 + s_hypotheses^2 + b^2),
        b^2 = (c^2 / d^2 + s^2) (value - nominal)^2,

    with the standard errors of cross-validation and of the final fit, the spread of the value over
    comparable hypotheses, and a bias b of two causes. The declared parameters have a scale that is
    known to the share s only (`ModelPrior.scale`). A residual is unexplained: if its amplitude is
    1/d of the effect's response, it shifts the magnitude by 1/d times the correlation of both, of
    which only the usual size c (`Thresholds.rest_correlation`) is known. The bias widens the
    interval but does not lower the confidence: `Support.mimic` covers an effect that merely
    resembles the residual.
    """
    posterior, errors = explanation.posterior, []
    scale = posterior.prior.scale
    for effect, values, scored, fitted in zip(
        explanation.fit.effects,
        explanation.fit.values,
        posterior.best.widths,
        explanation.fit.widths,
        strict=True,
    ):
        parts = zip(scored, fitted, posterior.spread(effect), strict=True)
        formal = [math.hypot(max(held_out, fit), spread) for held_out, fit, spread in parts]
        distance = _largest_change(effect, values, posterior.nominal)
        share = math.hypot(thresholds.rest_correlation / support[effect].dominance, scale)
        bias = share * distance
        widest = WIDEST * distance / thresholds.interval_half_width
        count = effect.kind.magnitudes
        # The limit applies to the bias alone: a formal error beyond it stays as it is. A residual
        # says little about shapes, so only magnitudes are widened.
        widened = [min(math.hypot(width, bias), max(width, widest)) for width in formal[:count]]
        errors.append((*widened, *formal[count:]))
    return errors


def _largest_change(effect: Effect, values: Sequence[float], nominal: Plant) -> float:
    """Return the largest distance of an effect's magnitudes from nominal.

    Several magnitudes are the coefficients of one force, which a bias shifts as a whole. A limit
    that the nominal machine lacks is compared with zero.
    """
    magnitudes = values[: effect.kind.magnitudes]
    return max(
        abs(value) if distance > 0.5 * UNLIMITED else distance
        for value, distance in zip(magnitudes, effect.distances(values, nominal), strict=True)
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


def find_traces(
    explanation: Explanation, named: Sequence[Effect], evidence: Evidence, thresholds: Thresholds
) -> tuple[Finding, ...]:
    """Find effects that may be present beside the named ones but are too uncertain to be named.

    Parameters
    ----------
    explanation
        Result of the search.
    named
        Effects that are named.
    evidence
        Recordings that were fitted.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    tuple of Finding
        Additional effects of the likeliest hypothesis that contains all named ones and more. Empty
        where no such hypothesis has a noticeable weight.
    """
    posterior, named_set = explanation.posterior, set(named)
    for hypothesis in posterior.ranking:
        scored, effects = hypothesis.scored, set(hypothesis.scored.fit.effects)
        if hypothesis.weight < TRACE_WEIGHT or not named_set < effects:
            continue
        additional = [effect for effect in scored.fit.effects if effect not in named_set]
        gained = posterior.closes(scored) - posterior.closes(posterior.best)
        if gained < TRACE_SHARE:
            continue
        return tuple(
            Finding(
                name=_name(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=posterior.inclusion(effect),
                alternatives=(_name(effect),),
                share=max(gained, 0.0) / len(additional),
                title=effect.kind.title,
            )
            for effect, values, widths in zip(
                scored.fit.effects, scored.fit.values, scored.widths, strict=True
            )
            if effect in additional
        )
    return ()


def find_nearest(explanation: Explanation, evidence: Evidence) -> Nearest | None:
    """Find the best explanation of a gap for which no effect can be named.

    Parameters
    ----------
    explanation
        Result of the search.
    evidence
        Recordings that were fitted.

    Returns
    -------
    Nearest or None
        The best hypothesis with any effect, and its residual. None where no effect was fitted.
    """
    fits = [
        hypothesis.scored.fit
        for hypothesis in explanation.posterior.ranking
        if hypothesis.scored.fit.effects
    ]
    if not fits:
        return None
    residual, without = (
        float((relative_errors(evidence, plant) ** 2).mean() ** 0.5)
        for plant in (fits[0].plant, evidence.plant)
    )
    return Nearest(tuple(_name(effect) for effect in fits[0].effects), residual, without)


def _name(effect: Effect) -> Name:
    return Name(effect.component, effect.kind.name)


def estimates(
    effect: Effect,
    values: Sequence[float],
    widths: Sequence[float],
    evidence: Evidence,
    wider: float = STANDARD.interval_half_width,
) -> dict[str, Estimate]:
    """Return the fitted parameters of an effect with their intervals.

    Parameters
    ----------
    effect
        Effect that was fitted.
    values, widths
        Values of its parameters and their standard errors, SI.
    evidence
        Recordings that were fitted.
    wider
        Half width of an interval in standard errors.

    Returns
    -------
    dict
        Parameter name → estimate, for the parameters that the recordings determine.
    """
    nominal = effect.nominal(evidence.plant)
    # The instant of sampling within a tick is a tolerance, so no delay is known better than that.
    # Divided here because the interval is `wider` times as wide: half of it is then at least the
    # tolerance.
    least: dict[str, float] = {name: _timing(evidence) / wider for name in LATE_BY_TIME}
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
        # A secondary parameter of width zero was not fitted: no recorded motion depends on it.
        if width > 0.0 or name in (effect.kind.parameters[0], *effect.kind.constants)
    }


def list_unobservable(
    explanation: Explanation, findings: Sequence[Finding]
) -> tuple[Unobservable, ...]:
    """List the effects that the recordings could not show at any size.

    Parameters
    ----------
    explanation
        Result of the search.
    findings
        Findings, which are left out of the list.

    Returns
    -------
    tuple of Unobservable
        Effects with the reason.
    """
    why = "at no size that was tried does it change these data by more than their noise"
    named = {(finding.name.component, finding.name.kind) for finding in findings}
    return tuple(
        Unobservable(effect.component, effect.kind.name, why)
        for effect in explanation.unobservable
        if (effect.component, effect.kind.name) not in named
    )
