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

from rigtwin.components import Effect, measures
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.numerics.arrays import Array

CHANCE = 2.0
"""Standard deviations of the power of noise in a band that are no rest."""
WITHIN = 0.3
"""Slope k of the density within noise and declared error: the noise is estimated from above, and
what is gained within the declared error is little evidence of an effect."""
RARE = (
    "backlash",
    "compliance",
    "mount",
    "cogging",
    "relaxation",
    "drag",
    "load_friction",
    "deadband_asymmetry",
)
"""Kinds that few machines have; the rest that other friction leaves resembles them."""
CONTAINS_SIMPLER = ("two_lags", "mount", "deadband_asymmetry")
"""Kinds that become a simpler one at the end of their range."""
DOUBT = 0.5
"""Parameters that such a kind costs besides its own."""
IMMATERIAL_PRICE = 100.0
"""Nats that an effect costs at most which accounts for less than the declared model error."""
UNSTEADY_PRICE = 20.0
"""Nats by the square of the standard errors that a magnitude lacks."""
NEAR = 0.25
"""Standard errors within which that price doubles where an interval holds the nominal value."""
UNDONE_PRICE = 50.0
"""Nats that two effects cost at most which undo each other."""
TOLERANCE_PRICE = 50.0
"""Nats that an effect costs at most whose value lies within its declared tolerance."""


def misfit_of(levels: Array, pieces: Array, samples: Array) -> float:
    """Return minus twice the log predictive density; see the module's equation.

    Parameters
    ----------
    levels
        Held-out power q of each band of each signal.
    pieces, samples
        Numbers n and N, of the same shape.

    Returns
    -------
    float
        The sum over all bands.
    """
    narrow = samples / np.maximum(pieces, 1e-300)
    excess = np.maximum(levels - 1.0, 0.0)
    within = WITHIN * np.minimum(levels, 1.0)
    return float(np.sum(pieces * (within + np.log1p(excess * narrow))))


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
        self._fitter, self._thresholds = fitter, thresholds
        self._evidence: Evidence = fitter.evidence
        self._candidates = max(candidates, 1)
        self._pool = list(pool)
        self.empty = next(each for each in self._pool if not each.fit.effects)
        # What predicts held-out data best says how much is left, in how many samples, and how much
        # noise a plant like this carries. All are judged by that alike.
        reference = min(self._pool, key=lambda each: float(np.sum(each.levels * each.samples)))
        self._noise = 1.0 + reference.excess
        pieces = reference.pieces
        self.pieces = pieces
        self.samples = float(np.sum(pieces))
        self.signal_samples = self.samples / pieces.shape[1]
        beyond = 1.0 - 1.0 / np.maximum(self.levels(reference), 1.0)
        self.discrepancy = float(np.sum(pieces * beyond) / self.samples)
        t, share = self._thresholds, self.discrepancy
        self.temper = t.temper + t.discrepancy_temper * self.signal_samples * share

    @property
    def nominal(self) -> Plant:
        """The plant without any effect."""
        return self._fitter.plant

    def levels(self, scored: Scored) -> Array:
        """Power of a held-out residual in units of noise and declared error at the reference."""
        return scored.levels / self._noise

    # Cost

    def loss(self, scored: Scored) -> float:
        """Minus the log predictive density, nats."""
        return 0.5 * misfit_of(self.levels(scored), self.pieces, scored.samples)

    def price(self, effect: Effect) -> float:
        """Nats that an effect must gain to be worth its parameters."""
        t, share = self._thresholds, self.discrepancy
        each = share * t.discrepancy_price * self.signal_samples
        count = float(len(effect.kind.parameters))
        starts = self._fitter.starts(effect)
        if starts.quadrature:
            # Each pitch of a wave is a place of its own, and was looked at in two phases.
            count += math.log2(len(starts.values) / 2)
        elif count == 1.0 and effect.kind.name in CONTAINS_SIMPLER:
            count += DOUBT
        first = (1.0 - share) * (t.occam_quiet + t.materiality * self.samples)
        first += share * t.occam_discrepant + math.log(self._candidates)
        rare = t.rare_odds + share * t.rare_price * self.signal_samples
        rare = rare if is_rare(effect) else 0.0
        return first + rare + count * each + (count - 1.0) * t.shape_price

    def price_for_one(self) -> float:
        """Nats that an ordinary effect of one parameter must gain."""
        t, share = self._thresholds, self.discrepancy
        return (
            (1.0 - share) * (t.occam_quiet + t.materiality * self.samples)
            + share * (t.occam_discrepant + t.discrepancy_price * self.signal_samples)
            + math.log(self._candidates)
        )

    def _doubt(self, scored: Scored) -> float:
        """Nats that values cost which are badly known or no more than a declared tolerance."""
        t, cost = self._thresholds, 0.0
        new = [
            effect.nominal(self._fitter.plant)[effect.kind.parameters[0]] == 0.0
            for effect in scored.fit.effects
        ]
        for one in range(len(new)):
            for other in range(one):
                # What corrects a nominal value that is too high undoes nothing; two effects that
                # are both new may undo each other.
                if new[one] and new[other]:
                    lacking = (t.undone - scored.together[one, other]) / (0.5 * t.undone)
                    cost += UNDONE_PRICE * float(np.clip(lacking, 0.0, 1.0))
        machine = self._evidence.machine
        form = float(np.mean([machine.form_of(row) for row in machine.rows]))
        for effect, share in zip(scored.fit.effects, scored.accounts, strict=True):
            # What is less than the declared error of the model is no effect.
            immaterial = float(np.clip(t.material - share / form, 0.0, 1.0))
            cost += machine.prior.even * IMMATERIAL_PRICE * immaterial
            if is_rare(effect):
                lacking = float(np.clip(1.0 - share / t.rare_share, 0.0, 1.0))
                cost += self.discrepancy * lacking * t.rare_doubt * self.signal_samples
        for effect, values, widths in zip(
            scored.fit.effects, scored.fit.values, scored.widths, strict=True
        ):
            parameter = effect.kind.parameters[0]
            off = abs(values[0] - effect.nominal(self._fitter.plant)[parameter])
            sure = off / max(widths[0], 1e-300)
            lacking = max(t.steady - sure, 0.0) ** 2
            # An interval that holds the nominal value names nothing: the price rises steeply there.
            cost += UNSTEADY_PRICE * lacking * (1.0 + (max(t.wider - sure, 0.0) / NEAR) ** 2)
            tolerance = self._evidence.machine.tolerance_of(effect.group, parameter)
            if tolerance is not None:
                width = self._evidence.width(tolerance)
                if tolerance.relative:
                    nominal = effect.nominal(self._evidence.plant)[parameter]
                    width = tolerance.half_width * abs(nominal)
                beyond = off / max(width, 1e-300)
                cost += TOLERANCE_PRICE * float(np.clip(t.within_tolerance - beyond, 0.0, 1.0))
        return cost

    def cost(self, scored: Scored) -> float:
        """Minus the score of a hypothesis, nats; infinite where a value stands at its bound."""
        if scored.bounded:
            return math.inf
        prices = sum(self.price(effect) for effect in scored.fit.effects)
        return self.loss(scored) + prices + self._doubt(scored)

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

    # What follows for an effect

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
            if each.weight < self._thresholds.member * top or len(others) != 1:
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
        samples, levels = self.best.samples, self.levels(self.best)
        chance = CHANCE * np.sqrt(2.0 / np.maximum(self.pieces, 1.0))
        within = np.minimum(levels, 1.0)
        beyond = within + np.maximum(levels - within - chance, 0.0)
        return 0.5 * (
            misfit_of(beyond, self.pieces, samples) - misfit_of(within, self.pieces, samples)
        )

    @property
    def rest(self) -> float:
        """Excess of the best hypothesis, as a share of noise and declared error."""
        return float(self.excess(self.best).sum() / np.sum(self.best.samples))


def is_rare(effect: Effect) -> bool:
    """Whether few machines have it; the gain of a sensor is one such effect, its zero is not."""
    if measures(effect.of()):
        return effect.kind.name != "offset"
    return effect.kind.name in RARE
