"""First look: the size of the gap and the likely effects, before anything is fitted.

Every effect is tried alone, and its benefit is extrapolated to first order from a small change. The
final diagnosis fits the effects together and may name others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Name
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.thresholds import Thresholds

MOST_SUSPECTS = 6
"""Largest number of suspects."""
COMPARABLE = 0.3
"""Share of the best suspect's promise from which another effect is a suspect too."""


@dataclass(frozen=True)
class FirstLook:
    """Preliminary result of a running diagnosis.

    Attributes
    ----------
    gap
        Sensor → rms of measured minus predicted in noise floors (1 is noise alone), the largest
        first.
    suspects
        Effects, and the share of the gap's power that each may explain alone, the largest first.
        Empty where there is no gap.
    """

    gap: dict[str, float]
    suspects: tuple[tuple[Name, float], ...]

    def __str__(self) -> str:
        levels = ", ".join(f"{name} {level:.3g}" for name, level in self.gap.items())
        if not self.suspects:
            return f"no significant gap (noise floors: {levels})"
        named = ", ".join(f"{name} ({100 * share:.0f} %)" for name, share in self.suspects)
        return f"suspects {named}; noise floors: {levels}"


def look_first(
    fitter: Fitter, screened: Sequence[Screened], least: float, thresholds: Thresholds
) -> FirstLook:
    """Summarise the screening of all effects.

    Parameters
    ----------
    fitter
        Fitter that screened the effects.
    screened
        Every effect of the library, tried at the values from which a search for it starts.
    least
        χ² that an effect must explain to be a finding.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    FirstLook
        Gap of each sensor, and the suspects.
    """
    evidence = fitter.evidence
    gap = fitter.nominal_fit.misfit - evidence.expected
    foremost = sorted(screened, key=lambda effect: -effect.promise)[:MOST_SUSPECTS]
    most = foremost[0].promise if foremost else 0.0
    # A gap in few frequencies is lost in the χ² of all of them, but one effect still explains it.
    has_gap = gap > thresholds.residual_excess * evidence.expected or most > 2.0 * least
    suspects = [
        (
            Name(candidate.effect.component, candidate.effect.kind.name),
            # A promise to first order may exceed the whole gap.
            min(candidate.promise / max(gap, most, 1e-300), 1.0),
        )
        for candidate in foremost
        if has_gap and candidate.promise >= max(least, COMPARABLE * most)
    ]
    return FirstLook(_levels(evidence), tuple(suspects))


def _levels(evidence: Evidence) -> dict[str, float]:
    """Gap of each sensor over all recordings, in noise floors."""
    powers = ticks = np.zeros(len(evidence.names))
    for recorded, residual in zip(
        evidence.lines, evidence.differences(evidence.plant), strict=True
    ):
        powers = powers + recorded.total((residual / recorded.noise[:, None]) ** 2)
        ticks = ticks + recorded.counts.sum(axis=1)
    levels = np.sqrt(powers / np.maximum(ticks, 1.0))
    order = np.argsort(-levels)
    return {evidence.names[number]: float(levels[number]) for number in order}
