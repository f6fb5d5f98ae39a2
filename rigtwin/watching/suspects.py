"""Suspects of a gap: a quick search in which each effect is tried alone."""

from __future__ import annotations

import numpy as np

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import candidates
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD
from rigtwin.watching.alarm import Suspect

FITTED = 12
"""Number of effects that are fitted, the most promising ones."""
NAMED = 4
"""Maximum number of suspects."""
TEMPERED = 0.05
"""Tempering of the misfit, as a share of the remaining misfit."""
WORTH = 0.02
"""Smallest probability of a suspect."""


def find_suspects(evidence: Evidence) -> tuple[Suspect, ...]:
    """Return the effects that may cause a gap, if the cause is one effect of the library.

    Parameters
    ----------
    evidence
        Evidence in which only the ticks of the gap count.

    Returns
    -------
    tuple of Suspect
        Suspects, the likeliest first; empty if no effect explains any of the gap.
    """
    # Accuracy is traded for speed: the test is still running.
    searched = evidence.thin().halve_steps()
    # An effect must lower χ² by twice the nats of its prior, as where only noise remains.
    price = 2.0 * (STANDARD.occam_quiet + STANDARD.materiality * evidence.expected)
    fitter, least = Fitter(searched), price
    without = fitter.nominal_fit
    with Threads() as threads:
        screened = threads.map(fitter.screen, candidates(evidence))
        screened.sort(key=lambda candidate: -candidate.promise)
        promising = [candidate for candidate in screened[:FITTED] if candidate.promise >= least]
        tried = threads.map(fitter.fit_one, promising)
    fits = [fit for fit in tried if fit.misfit + least < without.misfit]
    if not fits:
        return ()
    costs = np.array([fit.misfit for fit in fits])
    # A misfit that even the best fit leaves means that the model is wrong; then differences of the
    # misfit prove less, and the weights exp(−χ²/2) are tempered.
    remaining = max(min(fit.misfit for fit in fits) - evidence.expected, 0.0)
    temper = STANDARD.temper + TEMPERED * remaining
    # Bounded by exp(−700), which is still a double above 0.
    weights = np.exp(-np.minimum((costs - costs.min()) / (2.0 * temper), 700.0))
    weights /= weights.sum()
    gap = max(without.misfit - evidence.expected, 1e-300)
    suspects = [
        _suspect(
            # No probability is certain: causes outside the library have a share too.
            fit,
            (without.misfit - fit.misfit) / gap,
            STANDARD.highest_confidence * float(weight),
        )
        for fit, weight in zip(fits, weights, strict=True)
    ]
    suspects.sort(key=lambda suspect: -suspect.probability)
    return tuple(suspect for suspect in suspects[:NAMED] if suspect.probability >= WORTH)


def _suspect(fit: Fit, explained: float, probability: float) -> Suspect:
    (effect,), (values,) = fit.effects, fit.values
    return Suspect(
        effect=effect.name,
        values=dict(zip(effect.kind.parameters, values, strict=True)),
        explained=min(max(explained, 0.0), 1.0),
        probability=probability,
    )
