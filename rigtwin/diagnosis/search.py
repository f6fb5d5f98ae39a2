"""What a search among effects works with, and every effect fitted alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook, look_first
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.ranking import penalised_cost
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

REFITTED = 6
"""Explanations that are fitted again with the tolerances taken at them."""
OUTDONE = 3.0
"""Times the χ² of an explanation that leaves no more than noise from which another is not fitted
again: taking the tolerances at it took away 37 % of it at most, in 131 fits."""


def detection_limit(evidence: Evidence, thresholds: Thresholds = STANDARD) -> float:
    """χ² that an effect must explain to be a finding on this evidence.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.
    thresholds
        What figures are held against.

    Returns
    -------
    float
        The greater of an absolute limit and a share of what noise alone leaves.
    """
    return max(thresholds.detected, thresholds.noticeable * evidence.expected)


@dataclass(frozen=True)
class Search:
    """What a search needs. coarse, fitter: on evidence of half as many steps, and on all;
    threads: that fit side by side; told: called with the first look."""

    coarse: Fitter
    fitter: Fitter
    effects: Sequence[Effect]
    least: float
    thresholds: Thresholds
    threads: Threads
    told: Callable[[FirstLook], object] = lambda _: None

    def cost(self, fit: Fit) -> float:
        return penalised_cost(fit, self.thresholds.price)

    def fit_singles(self) -> tuple[Fit, list[Fit]]:
        """The nominal plant and each effect alone, the best again with the tolerances taken at
        them."""
        screened = self.threads.map(self.coarse.screen, self.effects)
        self.told(look_first(self.coarse, screened, self.least, self.thresholds))
        most = max((each.promise for each in screened), default=0.0)
        worth = self.thresholds.promising * max(most, self.least)
        singles = self.threads.map(
            self.coarse.fit_one, [each for each in screened if each.promise >= worth]
        )
        singles += [self.coarse.unfitted(each) for each in screened if each.promise < worth]
        singles.sort(key=self.cost)
        refit = self.fitter.refit_with_tolerances
        if self.coarse.nothing.misfit - singles[0].misfit < worth:
            return refit(self.fitter.nothing), singles
        # Those far behind stay there, however the tolerances are taken.
        near = (
            singles[0].misfit
            + self.thresholds.near * max(self.coarse.nothing.misfit - singles[0].misfit, 0.0)
            + 2.0 * self.least
        )
        close = [fit for fit in singles[:REFITTED] if fit.misfit <= near]
        if self.fitter.evidence.machine.rough:
            nothing, *tried = self.threads.map(
                lambda fit: self.fitter.settle(fit) if fit.effects else refit(fit),
                [self.fitter.nothing, *close],
            )
        else:
            nothing, best = self.threads.map(refit, [self.fitter.nothing, close[0]])
            others = [fit for fit in close[1:] if not self._outdoes(best, fit)]
            tried = [best, *self.threads.map(refit, others)]
        again = {fit.effects for fit in tried}
        tried += [fit for fit in singles if fit.effects not in again]
        tried.sort(key=self.cost)
        return nothing, tried

    def _outdoes(self, best: Fit, other: Fit) -> bool:
        """Whether one explanation leaves no more than noise, and another leaves far more."""
        noise = self.fitter.evidence.expected_misfit(best.plant)
        enough = (1.0 + self.thresholds.unexplained) * noise
        return best.misfit <= enough and other.misfit > OUTDONE * best.misfit
