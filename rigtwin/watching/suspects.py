"""Which effect may be behind a gap: a first look, each effect alone."""

from __future__ import annotations

import numpy as np

from rigtwin.diagnosis.attribute import detection_limit, library
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.ranking import penalised_cost
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.watching.alarm import Suspect

FITTED = 12
"""Effects that are fitted, those that promise most."""
NAMED = 4
"""Suspects at most."""
WORTH = 0.02
"""Probability from which one is named."""


def find_suspects(evidence: Evidence, thresholds: Thresholds = STANDARD) -> tuple[Suspect, ...]:
    """What may be behind a gap, if it is one effect of the library.

    Parameters
    ----------
    evidence
        With the ticks that show the gap counted, about the twin that they are held against.
    thresholds
        What figures are held against.

    Returns
    -------
    tuple of Suspect
        The likeliest first; none if nothing explains any of it.
    """
    searched = (evidence.thin() if evidence.machine.rough else evidence).halve_steps()
    fitter, least = Fitter(searched), detection_limit(evidence, thresholds)
    nothing = fitter.nothing
    with Threads() as threads:
        screened = threads.map(fitter.screen, library(evidence))
        screened.sort(key=lambda each: -each.promise)
        promising = [each for each in screened[:FITTED] if each.promise >= least]
        tried = threads.map(fitter.fit_one, promising)
    found = [fit for fit in tried if _cost(fit, thresholds) < nothing.misfit]
    if not found:
        return ()
    costs = np.array([_cost(fit, thresholds) for fit in found])
    left = max(min(fit.misfit for fit in found) - evidence.expected, 0.0)
    temper = thresholds.temper + thresholds.form_temper * left
    weights = np.exp(-np.minimum((costs - costs.min()) / (2.0 * temper), 700.0))
    weights /= weights.sum()
    gap = max(nothing.misfit - evidence.expected, 1e-300)
    suspects = [
        _suspect(fit, (nothing.misfit - fit.misfit) / gap, thresholds.sure * float(weight))
        for fit, weight in zip(found, weights, strict=True)
    ]
    suspects.sort(key=lambda each: -each.probability)
    return tuple(each for each in suspects[:NAMED] if each.probability >= WORTH)


def _cost(fit: Fit, thresholds: Thresholds) -> float:
    return penalised_cost(fit, thresholds.price)


def _suspect(fit: Fit, explained: float, probability: float) -> Suspect:
    (effect,), (values,) = fit.effects, fit.values
    return Suspect(
        effect=effect.name,
        values=dict(zip(effect.kind.parameters, values, strict=True)),
        explained=min(max(explained, 0.0), 1.0),
        probability=probability,
    )
