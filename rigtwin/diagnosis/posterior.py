"""Weights of hypotheses, and what follows from them for each effect.

The score of a hypothesis is its log predictive density on data left out of its fit [Vehtari,
Gelman, Gabry 2017], less the price of its parameters. Let a signal have N samples, of which n are
independent, and let its held-out residual have the power q in units of noise and declared error.
Then

    -2 ln p = k n q                              for q <= 1,
    -2 ln p = k n + n ln(1 + (q - 1) N / n)      for q > 1:

a Gaussian whose variance is that of the noise, and of a discrepancy of unknown scale in n of the
samples where more is left [Kennedy, O'Hagan 2001]. Weights are proportional to exp(score / temper),
as in pseudo-BMA [Yao, Vehtari, Simpson, Gelman 2018]. All of it is continuous in the data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.prices import Prices
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.numerics.arrays import Array


def misfit_of(levels: Array, pieces: Array, samples: Array, within: float) -> float:
    """Return minus twice the log predictive density; see the module's equation.

    Parameters
    ----------
    levels
        Held-out power q of each band of each signal.
    pieces, samples
        Numbers n and N, of the same shape.
    within
        Factor k.

    Returns
    -------
    float
        The sum over all bands.
    """
    narrow = samples / np.maximum(pieces, 1e-300)
    excess = np.maximum(levels - 1.0, 0.0)
    return float(np.sum(pieces * (within * np.minimum(levels, 1.0) + np.log1p(excess * narrow))))


@dataclass(frozen=True)
class Weighted:
    """A hypothesis and its weight among all that were tried."""

    scored: Scored
    cost: float
    weight: float


class Posterior:
    """All hypotheses that were tried, the one of least cost first."""

    def __init__(
        self, pool: Sequence[Scored], fitter: Fitter, candidates: int, thresholds: Thresholds
    ) -> None:
        """pool: scored fits, the empty one among them; candidates: number of effects searched."""
        self._fitter, self._thresholds, self._pool = fitter, thresholds, list(pool)
        self.empty = next(each for each in self._pool if not each.fit.effects)
        # What predicts held-out data best says how much is left, in how many samples, and how much
        # noise a plant like this carries. All hypotheses are judged by that alike.
        reference = min(self._pool, key=lambda each: float(np.sum(each.levels * each.samples)))
        self._noise, self._pieces = 1.0 + reference.excess, reference.pieces
        samples, signals = float(np.sum(self._pieces)), self._pieces.shape[1]
        beyond = 1.0 - 1.0 / np.maximum(self.levels(reference), 1.0)
        self.discrepancy = float(np.sum(self._pieces * beyond) / samples)
        self.temper = (
            thresholds.temper + thresholds.discrepancy_temper * self.discrepancy * samples / signals
        )
        self.prices = Prices(fitter, thresholds, candidates, samples, signals, self.discrepancy)

    @property
    def nominal(self) -> Plant:
        """The plant without any effect."""
        return self._fitter.plant

    def levels(self, scored: Scored) -> Array:
        """Power of a held-out residual in units of noise and declared error at the reference."""
        return scored.levels / self._noise

    def loss(self, scored: Scored) -> float:
        """Minus the log predictive density, nats."""
        return self._density(self.levels(scored), scored)

    def _density(self, levels: Array, scored: Scored) -> float:
        """Minus the log predictive density of a hypothesis that leaves certain levels."""
        return 0.5 * misfit_of(
            levels, self._pieces, scored.samples, self._thresholds.within_noise_weight
        )

    def cost(self, scored: Scored) -> float:
        """Minus the score of a hypothesis, nats; infinite where a value stands at its bound."""
        if scored.bounded:
            return math.inf
        prices = sum(self.prices.of(effect) for effect in scored.fit.effects)
        return self.loss(scored) + prices + self.prices.of_values(scored)

    @cached_property
    def ranking(self) -> tuple[Weighted, ...]:
        """All hypotheses with their weights, the best first."""
        costs = [self.cost(each) for each in self._pool]
        least = min(costs)
        raw = [math.exp(-min((cost - least) / self.temper, 700.0)) for cost in costs]
        total = sum(raw)
        weighted = [
            Weighted(each, cost, weight / total)
            for each, cost, weight in zip(self._pool, costs, raw, strict=True)
        ]
        return tuple(sorted(weighted, key=lambda each: each.cost))

    @property
    def best(self) -> Scored:
        """The hypothesis of least cost."""
        return self.ranking[0].scored

    def inclusion(self, effect: Effect) -> float:
        """Probability of an effect: the weight of all hypotheses that contain it."""
        return sum(each.weight for each in self.ranking if effect in each.scored.fit.effects)

    def margin(self, effect: Effect) -> float:
        """Nats by which the best hypothesis without an effect and its rivals is worse."""
        out = {effect, *self.rivals(effect)}
        costs = [each.cost for each in self.ranking if out.isdisjoint(each.scored.fit.effects)]
        return min(min(costs, default=math.inf) - self.ranking[0].cost, 1e6)

    def spread(self, effect: Effect) -> tuple[float, ...]:
        """Standard deviation of the values of an effect over all hypotheses that contain it, about
        those of the best one: how uncertain a value is because the hypothesis is."""
        number = self.best.fit.effects.index(effect)
        own = np.array(self.best.fit.values[number])
        variance, weight = np.zeros(len(own)), 0.0
        for each in self.ranking:
            if effect in each.scored.fit.effects:
                values = each.scored.fit.values[each.scored.fit.effects.index(effect)]
                variance += each.weight * (np.array(values) - own) ** 2
                weight += each.weight
        return tuple(np.sqrt(variance / weight).tolist())

    def rivals(self, effect: Effect) -> tuple[Effect, ...]:
        """Effects that the data cannot tell from one of the best hypothesis."""
        rest = set(self.best.fit.effects) - {effect}
        top = self.ranking[0].weight
        found = []
        for each in self.ranking:
            others = set(each.scored.fit.effects) - rest
            if each.weight < self._thresholds.rival_weight * top or len(others) != 1:
                continue
            (other,) = others
            if other != effect and rest <= set(each.scored.fit.effects):
                found.append(other)
        return tuple(dict.fromkeys(found))

    def excess(self, scored: Scored) -> Array:
        """Power beyond noise and declared error, shape (signals,)."""
        beyond = np.maximum(self.levels(scored) - 1.0, 0.0)
        return np.asarray(np.sum(scored.samples * beyond, axis=(0, 2)))

    def closes(self, scored: Scored) -> float:
        """Share of the gap's amplitude beyond noise and declared error that is closed."""
        before, after = self.excess(self.empty).sum(), self.excess(scored).sum()
        return 1.0 - math.sqrt(after / before) if before > 0.0 else 0.0

    @property
    def unexplained(self) -> float:
        """Nats that the best hypothesis loses to one that leaves noise and declared error, beyond
        what chance makes of noise."""
        levels = self.levels(self.best)
        chance = self._thresholds.chance_deviations * np.sqrt(2.0 / np.maximum(self._pieces, 1.0))
        within = np.minimum(levels, 1.0)
        beyond = within + np.maximum(levels - within - chance, 0.0)
        return self._density(beyond, self.best) - self._density(within, self.best)

    @property
    def leaves_something(self) -> bool:
        """Whether the rest of the best hypothesis could pay for one more effect."""
        return self.unexplained > self.prices.ordinary

    @property
    def rest(self) -> float:
        """Excess of the best hypothesis, as a share of noise and declared error."""
        return float(self.excess(self.best).sum() / np.sum(self.best.samples))
