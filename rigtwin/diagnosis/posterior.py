"""Posterior weights of hypotheses, and the inclusion probability of every effect.

The score of a hypothesis is its log predictive density on data held out of its fit [Vehtari,
Gelman, Gabry, Stat. Comput. 27 (2017) 1413], less the price of its effects. Let a band of a signal
have N samples, of which n are independent, and let its held-out residual have the power q in units
of noise and declared error. Then

    -2 ln p = k n q                              for q <= 1,
    -2 ln p = k n + n ln(1 + (q - 1) N / n)      for q > 1.

That is a Gaussian with the variance of the noise, and where the residual is larger, of a
discrepancy of unknown scale in n of the samples [Kennedy, O'Hagan, J. R. Stat. Soc. B 63 (2001)
425]. The factor k < 1 discounts gains within noise and declared error. The weights are

    w_i = exp(score_i / T) / sum_j exp(score_j / T),

as in pseudo-BMA [Yao, Vehtari, Simpson, Gelman, Bayesian Anal. 13 (2018) 917]. The temper T > 1
accounts for correlated samples. The weights are continuous in the data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.description.prior import ModelPrior
from rigtwin.diagnosis.deviance import Weighted, deviance
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.prices import Prices
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.numerics.arrays import Array

LEAST_NOISE = 1e-3
"""Smallest share of noise and declared error that a hypothesis may leave."""


class HypothesisPosterior:
    """Weights of all hypotheses that were scored.

    Parameters
    ----------
    pool
        Scored fits. The fit without effects is one of them.
    fitter
        Fitter of the evidence.
    candidates
        Number of effects that are searched.
    thresholds
        Thresholds and prices of the score.

    Attributes
    ----------
    empty
        Scored fit without effects.
    discrepancy
        Share of the independent samples that noise and declared error do not explain, 0 to 1.
    temper
        Divisor T of differences of the score.
    prices
        Prices of effects at this discrepancy.
    """

    def __init__(
        self, pool: Sequence[Scored], fitter: Fitter, candidates: int, thresholds: Thresholds
    ) -> None:
        self._fitter, self._thresholds, self._pool = fitter, thresholds, list(pool)
        self.empty = next(scored for scored in self._pool if not scored.fit.effects)
        # The hypothesis that predicts held-out data best fixes the discrepancy, the number of
        # independent samples and the propagated noise. All hypotheses are judged by the same
        # numbers: with its own n, a hypothesis with a more correlated residual would pay less
        # for it.
        reference = min(
            self._pool, key=lambda scored: float(np.sum(scored.levels * scored.samples))
        )
        self._noise, self._pieces = 1.0 + reference.excess, reference.pieces
        samples, signals = float(np.sum(self._pieces)), self._pieces.shape[1]
        # Of a power q > 1 noise and declared error explain 1 / q.
        beyond = 1.0 - 1.0 / np.maximum(self.levels(reference), 1.0)
        self.discrepancy = float(np.sum(self._pieces * beyond) / samples)
        self.temper = (
            thresholds.temper + thresholds.discrepancy_temper * self.discrepancy * samples / signals
        )
        self.prices = Prices(fitter, thresholds, candidates, samples, signals, self.discrepancy)

    @property
    def nominal(self) -> Plant:
        """Plant without any effect."""
        return self._fitter.plant

    @property
    def prior(self) -> ModelPrior:
        """Prior belief in the nominal values of the machine."""
        return self._fitter.evidence.machine.prior

    def levels(self, scored: Scored) -> Array:
        """Return the power of a held-out residual, in units of noise and declared error.

        The noise is that propagated at the reference hypothesis, less what the hypothesis itself
        smooths: a lag that takes noise out of a prediction explains nothing by that.

        Parameters
        ----------
        scored
            Cross-validated fit.

        Returns
        -------
        array
            Power q, shape (recordings, signals, bands).
        """
        relief = np.minimum(scored.relief - self.empty.relief, 0.0)
        return scored.levels / np.maximum(self._noise + relief, LEAST_NOISE)

    def loss(self, scored: Scored) -> float:
        """Return minus the log predictive density of a hypothesis, nats."""
        return self._loss_at(self.levels(scored), scored)

    def _loss_at(self, levels: Array, scored: Scored) -> float:
        """Return minus the log predictive density of a residual with the given powers, nats."""
        within = self._thresholds.within_noise_weight
        return 0.5 * deviance(levels, self._pieces, scored.samples, within)

    def cost(self, scored: Scored) -> float:
        """Return minus the score of a hypothesis: its loss and the prices of its effects, nats.

        A hypothesis that is held by a bound has an infinite cost.
        """
        if scored.bounded:
            return math.inf
        prices = sum(self.prices.price_effect(effect) for effect in scored.fit.effects)
        return self.loss(scored) + prices + self.prices.price_values(scored)

    @cached_property
    def ranking(self) -> tuple[Weighted, ...]:
        """All hypotheses with their weights, the best first."""
        costs = [self.cost(scored) for scored in self._pool]
        least = min(costs)
        # Costs are taken relative to the least one, and capped, so that exp cannot underflow to an
        # empty sum.
        # The cap also turns the infinite cost of a bounded hypothesis into a weight of e^-700,
        # which is none.
        raw = [math.exp(-min((cost - least) / self.temper, 700.0)) for cost in costs]
        total = sum(raw)
        weighted = [
            Weighted(scored, cost, weight / total)
            for scored, cost, weight in zip(self._pool, costs, raw, strict=True)
        ]
        return tuple(sorted(weighted, key=lambda hypothesis: hypothesis.cost))

    @property
    def best(self) -> Scored:
        """Hypothesis of least cost."""
        return self.ranking[0].scored

    def inclusion(self, effect: Effect) -> float:
        """Return the probability of an effect: the weight of all hypotheses that contain it."""
        return sum(
            hypothesis.weight
            for hypothesis in self.ranking
            if effect in hypothesis.scored.fit.effects
        )

    def margin(self, effect: Effect) -> float:
        """Return the nats by which the best hypothesis without an effect and its rivals is worse.

        Parameters
        ----------
        effect
            Effect of the best hypothesis.

        Returns
        -------
        float
            Difference of the costs, at most 1e6.
        """
        # Without the effect its rival would take the place, so the margin would only say how close
        # the rival is.
        excluded = {effect, *self.rivals(effect)}
        costs = [
            hypothesis.cost
            for hypothesis in self.ranking
            if excluded.isdisjoint(hypothesis.scored.fit.effects)
        ]
        return min(min(costs, default=math.inf) - self.ranking[0].cost, 1e6)

    def spread(self, effect: Effect) -> tuple[float, ...]:
        """Return the standard deviation of an effect's values over comparable hypotheses with it.

        It is taken about the values of the best hypothesis. It adds the uncertainty of the
        hypothesis to that of the fit. A hypothesis is comparable if it contains those effects of
        the best one that have rivals: with a rival in their place, all other values may differ,
        and the finding says which they are (`Rival.beside`). It is not comparable either if another
        effect of the same component stands in the place of one of the best one: the stiffness
        beside a curve over the stroke is another quantity than that beside a cubic spring.

        Parameters
        ----------
        effect
            Effect of the best hypothesis.

        Returns
        -------
        tuple of float
            Standard deviation of each value, in the units of the effect's parameters.
        """
        number = self.best.fit.effects.index(effect)
        chosen = np.array(self.best.fit.values[number])
        variance, weight = np.zeros(len(chosen)), 0.0
        contested = {member for member in self.best.fit.effects if self.rivals(member)}
        for hypothesis in self.ranking:
            fit = hypothesis.scored.fit
            if {effect, *contested} <= {*fit.effects} and not self._replaces(fit, effect.component):
                values = fit.values[fit.effects.index(effect)]
                # Squares about the best values and not about their mean, so that the bias of the
                # best hypothesis is contained.
                variance += hypothesis.weight * (np.array(values) - chosen) ** 2
                weight += hypothesis.weight
        return tuple(np.sqrt(variance / weight).tolist())

    def _replaces(self, fit: Fit, component: str) -> bool:
        """Return whether a fit has another effect in the place of one at a component."""
        here = {effect for effect in fit.effects if effect.component == component}
        best = {effect for effect in self.best.fit.effects if effect.component == component}
        return bool(best - here) and bool(here - best)

    def rivals(self, effect: Effect) -> tuple[Effect, ...]:
        """Return the effects that the data cannot tell from one of the best hypothesis.

        A rival takes the effect's place beside all its other effects, in a hypothesis of
        sufficient weight.
        """
        common = set(self.best.fit.effects) - {effect}
        least = self._thresholds.rival_weight * self.ranking[0].weight
        rivals = []
        for hypothesis in self.ranking:
            members = set(hypothesis.scored.fit.effects)
            exchanged = members - common
            if hypothesis.weight < least or len(exchanged) != 1:
                continue
            # Exactly one effect beside the common ones: the hypothesis exchanges the effect and
            # adds none.
            (candidate,) = exchanged
            if candidate != effect and common <= members:
                rivals.append(candidate)
        return tuple(dict.fromkeys(rivals))

    def excess(self, scored: Scored) -> Array:
        """Return the power beyond noise and declared error of each signal, shape (signals,)."""
        beyond = np.maximum(self.levels(scored) - 1.0, 0.0)
        return np.asarray(np.sum(scored.samples * beyond, axis=(0, 2)))

    def remaining(self, scored: Scored) -> Array:
        """Return the share of the amplitude of each signal's gap that a hypothesis leaves.

        Parameters
        ----------
        scored
            Scored hypothesis.

        Returns
        -------
        array
            Shares, shape (signals,): 0 for a signal at noise, infinite for one that only the
            hypothesis moves away from noise.
        """
        before, after = self.excess(self.empty), self.excess(scored)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(after > 0.0, np.sqrt(after / before), 0.0)

    def closes(self, scored: Scored) -> float:
        """Return the share of the gap's amplitude beyond noise and declared error that a hypothesis
        closes."""
        before, after = self.excess(self.empty).sum(), self.excess(scored).sum()
        return 1.0 - math.sqrt(after / before) if before > 0.0 else 0.0

    @property
    def unexplained(self) -> float:
        """Log predictive density that the best hypothesis loses to a perfect one, nats.

        A perfect hypothesis leaves noise and declared error in every band. Excesses that chance
        makes of noise do not count.
        """
        levels = self.levels(self.best)
        # The mean square of n samples of unit variance has the standard deviation sqrt(2 / n).
        chance = self._thresholds.chance_deviations * np.sqrt(2.0 / np.maximum(self._pieces, 1.0))
        within = np.minimum(levels, 1.0)
        beyond = within + np.maximum(levels - within - chance, 0.0)
        return self._loss_at(beyond, self.best) - self._loss_at(within, self.best)

    @property
    def has_unexplained_residual(self) -> bool:
        """Whether the residual of the best hypothesis could pay for one more effect."""
        return self.unexplained > self.prices.ordinary

    @property
    def residual_excess(self) -> float:
        """Power of the best hypothesis beyond noise and declared error, as a share of both."""
        return float(self.excess(self.best).sum() / np.sum(self.best.samples))
