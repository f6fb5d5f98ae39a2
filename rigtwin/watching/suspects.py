"""Which effect may be behind a gap: a first look, each effect alone."""

from __future__ import annotations

import numpy as np

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import candidates
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.watching.alarm import Suspect

FITTED = 12
"""Effects that are fitted, those that promise most."""
NAMED = 4
"""Suspects at most."""
TEMPERED = 0.05
"""Share of the rest by which differences of the misfit count less."""
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
    searched = evidence.thin().halve_steps()
    # Twice the nats that an effect must gain where noise alone is left, as chi-square.
    price = 2.0 * (thresholds.occam_quiet + thresholds.materiality * evidence.expected)
    fitter, least = Fitter(searched), price
    nothing = fitter.nominal_fit
    with Threads() as threads:
        screened = threads.map(fitter.screen, candidates(evidence))
        screened.sort(key=lambda each: -each.promise)
        promising = [each for each in screened[:FITTED] if each.promise >= least]
        tried = threads.map(fitter.fit_one, promising)
    found = [fit for fit in tried if fit.misfit + least < nothing.misfit]
    if not found:
        return ()
    costs = np.array([fit.misfit for fit in found])
    left = max(min(fit.misfit for fit in found) - evidence.expected, 0.0)
    temper = thresholds.temper + TEMPERED * left
    weights = np.exp(-np.minimum((costs - costs.min()) / (2.0 * temper), 700.0))
    weights /= weights.sum()
    gap = max(nothing.misfit - evidence.expected, 1e-300)
    suspects = [
        _suspect(
            fit, (nothing.misfit - fit.misfit) / gap, thresholds.highest_confidence * float(weight)
        )
        for fit, weight in zip(found, weights, strict=True)
    ]
    suspects.sort(key=lambda each: -each.probability)
    return tuple(each for each in suspects[:NAMED] if each.probability >= WORTH)


def _suspect(fit: Fit, explained: float, probability: float) -> Suspect:
    (effect,), (values,) = fit.effects, fit.values
    return Suspect(
        effect=effect.name,
        values=dict(zip(effect.kind.parameters, values, strict=True)),
        explained=min(max(explained, 0.0), 1.0),
        probability=probability,
    )
