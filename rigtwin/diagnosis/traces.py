"""Effects that an answer mentions without naming them."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.components import Effect
from rigtwin.diagnosis.estimates import estimates
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Finding, Name, Nearest, Unobservable
from rigtwin.diagnosis.thresholds import Thresholds

TRACE_WEIGHT = 1e-3
"""Weight from which a hypothesis with one more effect makes that effect a trace."""
TRACE_SHARE = 0.005
"""Share of the gap that the effects of a trace must close together."""


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
                name=name_effect(effect),
                parameters=estimates(
                    effect, values, widths, evidence, thresholds.interval_half_width
                ),
                confidence=posterior.inclusion(effect),
                alternatives=(name_effect(effect),),
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
    return Nearest(tuple(name_effect(effect) for effect in fits[0].effects), residual, without)


def name_effect(effect: Effect) -> Name:
    """Return the name of an effect."""
    return Name(effect.component, effect.kind.name)


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
