"""What can be said before anything is fitted: how large the gap is, in which sensors, and which
effects promise to explain it, each alone and to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Name
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.thresholds import Thresholds

NAMED = 6
"""Suspects at most."""
BESIDE = 0.3
"""Share of what the foremost suspect promises from which another is one too."""


@dataclass(frozen=True)
class FirstLook:
    """Of a diagnosis that goes on. gap: of each sensor, rms in noise floors, 1 is noise alone, the
    largest first; suspects: effects and the share of the gap's power that each may explain alone,
    the foremost first, none where there is no gap to speak of. The judgement may name others: what
    is seen here is only what a small change would do."""

    gap: dict[str, float]
    suspects: tuple[tuple[Name, float], ...]

    def __str__(self) -> str:
        levels = ", ".join(f"{name} {level:.3g}" for name, level in self.gap.items())
        if not self.suspects:
            return f"no gap to speak of (noise floors: {levels})"
        named = ", ".join(f"{name} ({100 * share:.0f} %)" for name, share in self.suspects)
        return f"suspects {named}; noise floors: {levels}"


def look_first(
    fitter: Fitter, screened: Sequence[Screened], least: float, thresholds: Thresholds
) -> FirstLook:
    """The first look.

    Parameters
    ----------
    fitter
        That screened.
    screened
        Every effect of the library, tried at the values from which a search for it starts.
    least
        χ² that an effect must explain to be a finding.
    thresholds
        What figures are held against.

    Returns
    -------
    FirstLook
        Its suspects.
    """
    evidence = fitter.evidence
    gap = fitter.nominal_fit.misfit - evidence.expected
    foremost = sorted(screened, key=lambda each: -each.promise)[:NAMED]
    most = foremost[0].promise if foremost else 0.0
    there = gap > thresholds.residual_excess * evidence.expected or most > 2.0 * least
    suspects = [
        (
            Name(each.effect.component, each.effect.kind.name),
            min(each.promise / max(gap, most, 1e-300), 1.0),
        )
        for each in foremost
        if there and each.promise >= max(least, BESIDE * most)
    ]
    return FirstLook(_levels(evidence), tuple(suspects))


def _levels(evidence: Evidence) -> dict[str, float]:
    """Each sensor's gap over all recordings."""
    powers = np.zeros(len(evidence.names))
    ticks = 0
    for each, left in zip(evidence.lines, evidence.differences(evidence.plant), strict=True):
        counts = each.fade.max(axis=0) > 0.5
        powers += np.sum((left[:, counts] / each.noise[:, None]) ** 2, axis=1)
        ticks += int(counts.sum())
    levels = np.sqrt(powers / max(ticks, 1))
    order = np.argsort(-levels)
    return {evidence.names[number]: float(levels[number]) for number in order}
