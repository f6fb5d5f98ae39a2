"""Search for hypotheses: single effects first, then sets of effects, one change at a time.

1. Screen: simulate each effect at several values, and note its promise to first order.
2. Fit the promising effects alone, and the regular ones (friction, mass, stiffness) together.
3. Extend the best hypotheses by one effect. Replace each of their effects by those that resemble
   it while the others adapt themselves, and leave each out. Repeat as long as a better hypothesis
   is found.
4. Where a large residual remains, restart from other values and at other components, and search for
   the kinds that were left for later.
5. Leave effects out of the closest hypothesis and of the best ones, and merge two into one, as long
   as this helps.

A hypothesis is fitted on coarse evidence: half the integration steps, thinned where the models
allow it. It is scored on the same ticks with all integration steps.

The search ends early where its predictions have cost the effort of `Thresholds`, which is counted
in integration steps. A share of it is kept for step 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.effort import Effort
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook, look_first
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.merging import start_merged, start_with_summed_delays
from rigtwin.diagnosis.minima import leave_minimum
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.prices import is_rare
from rigtwin.diagnosis.proposals import choose_distinct, propose_additions, propose_replacements
from rigtwin.diagnosis.regulars import choose_regulars, fit_together, start_balanced
from rigtwin.diagnosis.rescaling import start_rescaled
from rigtwin.diagnosis.scoring import Scored, Scorer
from rigtwin.diagnosis.starts import (
    GATEWAY,
    REGULAR,
    Start,
    are_late_twins,
    start_elsewhere,
    start_in_series,
    start_otherwise,
    start_regular_instead,
    start_unfolded,
    start_with_base,
)
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.diagnosis.tolerance_refit import refit_with_tolerances

SETTLED = 6
"""Number of single effects that are refitted precisely."""
PRECISE = 2
"""Number of hypotheses next to a leader that are refitted precisely."""
SCORED = 4
"""Ratio of the hypotheses next to a leader that are scored to those refitted precisely."""
LONGER = 1
"""Number of effects by which an extended hypothesis may exceed the best one."""
LEADER_SHORTFALL = 0.5
"""A hypothesis is extended if it explains at most this share less than the closest one."""
MISSED = 10.0
"""Prices by which a hypothesis may be worse without an effect, or than the best one, to be worth a
fit."""
VARIED = 2
"""Number of effects tried in the place of each effect while the search climbs."""
COMPARED = 5
"""Number of effects tried in the place of each effect of the best hypothesis at the end."""
RIVALS = 3
"""Number of the best hypotheses whose effects are left out in turn at the end."""
BEGINNINGS = 4
"""Number of single effects that are extended where the best hypothesis leaves a large residual."""
FEW = 3
"""Number of effects up to which a hypothesis is varied before it is extended further."""
SHORT = 4
"""Number of effects up to which the variants of every leader are fitted."""
LATER = ("deadband", "stribeck")
"""Kinds that are searched only where the others leave a large residual, in machines whose effects
compound, as are the rare ones. They refine dry friction, or resemble what it leaves."""
STEADY_ROUNDS = 2
"""Rounds without a better hypothesis after which the search ends."""


@dataclass
class HypothesisSearch:
    """Search for the hypotheses that explain one body of evidence.

    Parameters
    ----------
    evidence
        Recordings about their nominal plant.
    effects
        Candidate effects.
    thresholds
        Thresholds of search and score.
    threads
        Threads that fit in parallel.
    on_first_look
        Called with the first look once all effects are screened, before any is fitted.

    Attributes
    ----------
    pool
        Best scored fit of each set of effects.
    coarse, fine
        Fitters on evidence with half and with all integration steps.
    screened
        Screened candidates.
    ended_early
        Whether the effort was spent before all hypotheses were tried.
    is_approximate
        Whether errors of initial states are corrected to first order.
    """

    evidence: Evidence
    effects: Sequence[Effect]
    thresholds: Thresholds
    threads: Threads
    on_first_look: Callable[[FirstLook], object] = lambda _: None
    pool: dict[frozenset[Effect], Scored] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._effort = Effort(self.thresholds.effort)
        self.ended_early = False
        # Where effects compound, every effect costs integrations of all joints.
        staged = self.evidence.machine.physics.compounds
        self._later = tuple(
            e for e in self.effects if staged and (is_rare(e) or e.kind.name in LATER)
        )
        self._searched = tuple(e for e in self.effects if e not in self._later)
        searched = copy(self.evidence.thin())
        searched.effort = self._effort
        self.coarse = Fitter(searched.halve_steps())
        self.is_approximate = any(model.has_linear_starts for model in searched.models)
        self.fine = Fitter(searched)
        self._scorer = Scorer(self.fine)
        self._extended: set[frozenset[Effect]] = set()
        self._reduced: set[frozenset[Effect]] = set()
        self._started: set[Start] = set()
        self._linearised: Linearised | None = None
        self.screened: list[Screened] = []

    @property
    def posterior(self) -> HypothesisPosterior:
        """Weights of all hypotheses scored so far."""
        return HypothesisPosterior(
            list(self.pool.values()), self.fine, len(self.effects), self.thresholds
        )

    def run(self) -> HypothesisPosterior:
        """Search until no change of the best hypotheses improves on them.

        Returns
        -------
        HypothesisPosterior
            All scored hypotheses with their weights.
        """
        singles = self._fit_singles()
        self._keep(
            self._refine(start_with_base(self.coarse, self.coarse.nominal_fit, self._searched))
        )
        if self._has_gap(singles):
            # Where effects compound, the gain of one servo may resemble the friction of all joints,
            # so the regular effects are fitted together before a climb begins with such a gain.
            # Where forces add up instead, a mass among them would hide the gain of a sensor.
            compounds = self.evidence.machine.physics.compounds
            if compounds:
                self._fit_regulars()
            # The cheapest single effect may explain one signal alone, so the single effect of least
            # misfit over all signals is extended as well. So is dry friction: in series with a
            # spring or a play it explains little by itself.
            dry = [fit for fit in singles if fit.effects[0].kind.name == GATEWAY]
            for fit in () if len(self.posterior.best.fit.effects) > 1 else (singles[0], *dry[:1]):
                fresh = frozenset(fit.effects) not in self._extended
                if fresh and self._may_gain():
                    self._extend(fit)
            self._climb()
            if not compounds and (
                self._may_gain()
                or len(self.posterior.best.fit.effects) > 1
                or self._has_free_joint()
            ):
                self._fit_regulars()
                self._climb()
            if self._may_gain():
                before = self.posterior.best
                self._restart()
                if self._improved(before) or len(before.fit.effects) <= SHORT:
                    self._climb()
            if self._later and self._may_gain():
                self._widen()
                self._climb()
            if self._may_gain():
                self._reduce_closest()
            self._vary_best()
        return self.posterior

    # Single effects

    def _fit_singles(self) -> list[Fit]:
        """Fit the nominal plant and each promising effect alone, the best fit first."""
        self.screened = self.threads.map(self.coarse.screen, self.effects)
        # The empty hypothesis comes first: the posterior and its prices refer to it.
        self._add([refit_with_tolerances(self.fine, self.fine.nominal_fit)])
        # Prices are in nats; a chi-square is twice as large.
        price = 2.0 * self.posterior.prices.ordinary
        self.on_first_look(look_first(self.coarse, self.screened, price, self.thresholds))
        # The best suspect of all is not left for later.
        suspect = max(self.screened, key=lambda screened: screened.promise, default=None)
        if suspect is not None and suspect.effect in self._later:
            self._searched = (*self._searched, suspect.effect)
        singles = self._fit_promising(self._searched)
        if singles:
            gain = max(self.coarse.nominal_fit.misfit - singles[0].misfit, 0.0)
            most = singles[0].misfit + self.thresholds.precise_fit_shortfall * gain + 2.0 * price
            # Tolerances estimated at the fit change a misfit too little to let a distant hypothesis
            # catch up.
            settled = [fit for fit in singles[:SETTLED] if fit.misfit <= most]
            self._settle(settled)
            self._add([fit for fit in singles[: 2 * SETTLED] if fit not in settled])
        return singles

    def _widen(self) -> None:
        """Search for all effects from now on, and fit those alone that were left for later."""
        self._searched = tuple(self.effects)
        self._extended.clear()
        self._keep(self._fit_promising(self._later))

    def _fit_promising(self, effects: Collection[Effect]) -> list[Fit]:
        """Fit each of several effects alone that may be worth its price, the best fit first."""
        most = max((screened.promise for screened in self.screened), default=0.0)
        price = 2.0 * self.posterior.prices.ordinary
        least = self.thresholds.promising_share * max(most, price)
        promising = [s for s in self.screened if s.promise >= least and s.effect in effects]
        return sorted(self.threads.map(self._fit_single, promising), key=lambda f: f.misfit)

    def _fit_single(self, screened: Screened) -> Fit:
        """Fit an effect alone; for a free joint also from the balance of forces."""
        fit = self.coarse.fit_one(screened)
        if screened.effect.kind.name in REGULAR:
            balanced = [
                self.coarse.refine(*start)
                for start in start_balanced(self.coarse, (screened.effect,))
            ]
            fit = min(fit, *balanced, key=lambda fit: fit.misfit) if balanced else fit
        return leave_minimum(self.coarse, fit)

    def _has_free_joint(self) -> bool:
        """Return whether a joint moves freely.

        The misfit of its motion may have several minima in one value, and one effect may resemble
        another.
        """
        return self.coarse.evidence.missing_force(self.coarse.plant) is not None

    def _may_gain(self) -> bool:
        """Return whether one more effect could be worth a fit beside the best hypothesis.

        A residual that is a small share of every signal's gap may be the error of an approximate
        search.
        """
        posterior = self.posterior
        if not posterior.has_unexplained_residual:
            return False
        if self.is_approximate:
            remaining = float(np.max(posterior.remaining(posterior.best)))
            if remaining <= self.thresholds.negligible_share:
                return False
        return not self._is_spent(1.0 - self.thresholds.last_effort_share)

    def _is_spent(self, share: float) -> bool:
        """Return whether a share of the effort is spent, and note that there was more to try."""
        spent = self._effort.share > share
        self.ended_early = self.ended_early or spent
        return spent

    def _has_gap(self, singles: Sequence[Fit]) -> bool:
        """Return whether an effect is worth its price, or the residual more than noise."""
        posterior = self.posterior
        return bool(posterior.best.fit.effects) or (
            bool(singles)
            and (
                self.coarse.nominal_fit.misfit - singles[0].misfit > 2.0 * posterior.prices.ordinary
                or posterior.residual_excess > self.thresholds.residual_excess
            )
        )

    # The pool

    def _add(self, fits: Sequence[Fit]) -> None:
        """Score fits, and keep the fit of least misfit for each set of effects."""
        for scored in self.threads.spread(self._scorer.score, fits):
            key = frozenset(scored.fit.effects)
            # One set of effects may be fitted from many starts. Only its best minimum is a
            # hypothesis; several would share the weight of one.
            known = self.pool.get(key)
            if known is None or _rank(scored) < _rank(known):
                self.pool[key] = scored

    def settle_on(self, fit: Fit, leaves_noise: bool) -> HypothesisPosterior:
        """Discard hypotheses that a confirmation has shown to fit the search's approximation.

        Parameters
        ----------
        fit
            Exact fit of the effects of the best hypothesis that were confirmed.
        leaves_noise
            Whether the residual of that fit is noise alone. No hypothesis then needs more effects.

        Returns
        -------
        HypothesisPosterior
            Weights of the hypotheses that are kept.
        """
        before, confirmed = frozenset(self.posterior.best.fit.effects), frozenset(fit.effects)
        if confirmed != before:
            if confirmed not in self.pool:
                self._add([self.fine.refine(fit.effects, fit.values)])
            costs = {
                frozenset(weighted.scored.fit.effects): weighted.cost
                for weighted in self.posterior.ranking
            }
            for known, cost in costs.items():
                # What the search preferred to an explanation of everything, it preferred for the
                # sake of its own approximation.
                preferred = known != confirmed and cost <= costs[confirmed]
                if known == before or (leaves_noise and (confirmed < known or preferred)):
                    del self.pool[known]
        return self.posterior

    def _settle(self, fits: Sequence[Fit]) -> None:
        """Refit with the tolerances estimated at the fit, on fine evidence, and score."""
        self._add(self.threads.map(partial(refit_with_tolerances, self.fine), fits))

    # Sets of effects

    def _fit_regulars(self) -> None:
        """Fit the regular effects together, and subsets of them."""
        price = self.posterior.prices.ordinary
        chosen = choose_regulars(self._searched, self.screened, price)
        if len(chosen) > 1:
            whole, reduced = fit_together(self.coarse, chosen, 2.0 * price, self.threads)
            self._keep([whole, *self._refine(reduced)])

    def _climb(self) -> None:
        """Extend the best hypotheses by one effect as long as better ones are found.

        A leader whose extension fails is varied. The climb ends after two rounds without a better
        hypothesis, or where the residual could pay for no further effect.
        """
        steady = 0
        while steady < STEADY_ROUNDS:
            before = self.posterior.best
            leader = self._next_leader()
            if leader is None or self._is_spent(1.0 - self.thresholds.last_effort_share):
                return
            self._extend(leader)
            if self._improved(before):
                # The effects that a short hypothesis began with may only resemble the true ones.
                best = self.posterior.best.fit
                if 1 < len(best.effects) <= FEW and self._may_gain():
                    self._vary(best, VARIED)
            else:
                if not self._may_gain():
                    return
                # A long hypothesis has many variants: only those of the best one are worth a fit.
                if leader == before.fit or len(leader.effects) <= SHORT:
                    self._vary(leader, VARIED)
            steady = 0 if self._improved(before) else steady + 1

    def _improved(self, before: Scored) -> bool:
        """Return whether the best hypothesis beats another by more than a tie.

        Differences below half a temper, a factor of 0.6 in weight, count as ties.
        """
        posterior = self.posterior
        return posterior.ranking[0].cost < posterior.cost(before) - 0.5 * posterior.temper

    def _next_leader(self) -> Fit | None:
        """Return the most promising hypothesis that was not extended yet, None if there is none."""
        ranked = self._ranked_fits()
        if not ranked:
            return None
        # A hypothesis that explains much less than the closest one is not worth extending.
        nominal, least = self.pool[frozenset()].fit.misfit, min(fit.misfit for fit in ranked)
        most = least + LEADER_SHORTFALL * max(nominal - least, 0.0)
        longest = len(ranked[0].effects) + LONGER
        near = [fit for fit in ranked if fit.misfit <= most and len(fit.effects) <= longest]
        dry = [f for f in near if any(e.kind.name == GATEWAY for e in f.effects)]
        # The closest fit is a leader even if its effects are not worth their price yet: the next
        # effect may make them so.
        closest = sorted(near, key=lambda fit: fit.misfit)
        twins = [fit for fit in near if are_late_twins(fit.effects, ranked[0].effects)]
        # The order is that in which they are tried: the best, the same with a delay for a lag, the
        # closest, further ones, and one with dry friction.
        leaders = (ranked[0], *twins, *closest[:1], *near[: self.thresholds.leaders], *dry[:1])
        for fit in leaders:
            if frozenset(fit.effects) not in self._extended:
                return fit
        return None

    def _ranked_fits(self) -> list[Fit]:
        """Return the fits of finite cost with at least one effect, the best first."""
        ranking = self.posterior.ranking
        fits = [weighted.scored.fit for weighted in ranking if math.isfinite(weighted.cost)]
        return [fit for fit in fits if fit.effects]

    def _extend(self, leader: Fit, count: int = 0) -> None:
        """Fit a hypothesis with one more effect, for each of the most promising effects.

        Their number is `count`, or where that is 0 the usual one (`Thresholds.additions`).
        """
        self._extended.add(frozenset(leader.effects))
        price = 2.0 * self.posterior.prices.ordinary
        proposals = choose_distinct(
            propose_additions(self.coarse, leader, self._searched, price, self.threads),
            count or self.thresholds.additions,
        )
        fits = self.threads.map(
            lambda proposal: self.coarse.refine(proposal.effects, proposal.values, proposal.space),
            proposals,
        )
        if self._may_gain():
            fits += self._refine(
                [
                    *start_in_series(self.coarse, leader, self._searched, self.pool.keys()),
                    *start_with_base(self.coarse, leader, self._searched),
                    *start_unfolded(self.coarse, leader, self._searched),
                ]
            )
        self._keep(fits)
        self._reduce_held_back()

    def _reduce_held_back(self) -> None:
        """Leave effects out of the closest hypothesis where only its values hold it back.

        An effect that stands in for another one keeps hardly any value beside it. The hypothesis
        then pays for that value far more than the effect itself is worth.
        """
        posterior = self.posterior
        closest = min(self.pool.values(), key=lambda scored: scored.fit.misfit)
        effects = closest.fit.effects
        if frozenset(effects) in self._reduced or not 1 < len(effects) <= SHORT:
            return
        prices = sum(posterior.prices.price_effect(effect) for effect in effects)
        if posterior.loss(closest) + prices < posterior.ranking[0].cost < posterior.cost(closest):
            self._reduced.add(frozenset(effects))
            self._keep(self._refine(self._leave_out(closest.fit)))

    def _vary(self, leader: Fit, count: int) -> None:
        """Fit a hypothesis without each effect, and with each replaced by `count` others."""
        starts = self._leave_out(leader)
        starts += propose_replacements(
            self.coarse, leader, self._linearise(leader), self._searched, count, self.threads
        )
        starts += start_regular_instead(self.coarse, leader, self._searched)
        starts += start_with_summed_delays(leader)
        starts += start_rescaled(self.coarse.plant, leader, self._searched)
        self._keep(self._refine(starts))

    def _linearise(self, fit: Fit) -> Linearised:
        """Return the linearised residual of a fit. The latest one is kept."""
        if self._linearised is None or self._linearised.fit is not fit:
            self._linearised = Linearised(self.coarse, fit)
        return self._linearised

    def _leave_out(self, fit: Fit) -> list[Start]:
        """Return a hypothesis without each effect that may be worth less than its price."""
        if len(fit.effects) < 2:
            return []
        linearised = self._linearise(fit)
        # An effect that is missed by far more than its price need not be left out in a fit. Both
        # misfits are those on coarse evidence, while `fit.misfit` may be one on fine evidence.
        most = linearised.misfit + MISSED * 2.0 * self.posterior.prices.ordinary
        reduced = linearised.leave_out_each()
        return [(rest, values) for misfit, rest, values in reduced if misfit < most]

    def _reduce_closest(self) -> None:
        """Leave effects out of the hypothesis of least misfit, one after another.

        A climb that began with effects that only resemble the true ones may add the true ones in
        the end. Such a long hypothesis counts for little until the others are left out.
        """
        closest = min((scored.fit for scored in self.pool.values()), key=lambda fit: fit.misfit)
        if len(closest.effects) > len(self.posterior.best.fit.effects):
            path = Linearised(self.coarse, closest).eliminate()
            self._keep(self._refine([(effects, values) for _, effects, values in path]))

    def _vary_best(self) -> None:
        """Look for rivals of the best hypothesis, until it stays the best."""
        best_fit = self.posterior.best.fit
        self._keep(self._refine(start_unfolded(self.coarse, best_fit, self._searched)))
        # The same hypothesis may win again after another one was the best, so the loop needs a
        # memory to end.
        varied: set[frozenset[Effect]] = set()
        reduced: set[tuple[Effect, ...]] = set()
        while len(best := self.posterior.best.fit.effects) > 1 and frozenset(best) not in varied:
            if self._is_spent(1.0):
                return
            varied.add(frozenset(best))
            reduced.add(best)
            self._vary(self.posterior.best.fit, COMPARED)
            self._merge(self.posterior.best.fit)
            self._extend_remainder(self.posterior.best.fit)
            # An effect that took the place of another may make a third one superfluous.
            rivals = [fit for fit in self._ranked_fits()[:RIVALS] if fit.effects not in reduced]
            reduced.update(fit.effects for fit in rivals)
            self._keep(self._refine([start for fit in rivals for start in self._leave_out(fit)]))

    def _extend_remainder(self, leader: Fit) -> None:
        """Look for other effects that explain what the weakest effect of a hypothesis explains.

        They may resemble that effect too little to be tried in its place.
        """
        remainders = [
            scored.fit
            for effects, scored in self.pool.items()
            if effects < frozenset(leader.effects) and len(effects) == len(leader.effects) - 1
        ]
        closest = min(remainders, key=lambda fit: fit.misfit, default=None)
        if closest is not None and frozenset(closest.effects) not in self._extended:
            # A linear estimate of what each of them explains does not tell for certain the best.
            self._extend(closest, 2 * self.thresholds.additions)

    def _merge(self, leader: Fit) -> None:
        """Fit a hypothesis with one effect in the place of each two."""
        starts = start_merged(
            self.coarse, leader, self._linearise(leader), self._searched, self.threads
        )
        self._keep(self._refine(starts))

    def _refine(self, starts: Sequence[Start]) -> list[Fit]:
        """Fit from the starts that were not fitted before."""
        # `dict.fromkeys` keeps the order, which a set would not: the same data must give the same
        # answer.
        fresh = [start for start in dict.fromkeys(starts) if start not in self._started]
        self._started.update(fresh)
        return self.threads.map(lambda start: self.coarse.refine(*start), fresh)

    def _keep(self, fits: Sequence[Fit]) -> None:
        """Refit the most promising coarse fits precisely, and score the next ones as they are."""
        if not fits:
            return
        price = 2.0 * self.posterior.prices.ordinary
        distinct: dict[frozenset[Effect], Fit] = {}
        # Sorted by misfit plus price, the first fit of each set is its best one.
        for fit in sorted(fits, key=lambda fit: fit.misfit + price * len(fit.effects)):
            distinct.setdefault(frozenset(fit.effects), fit)
        ranked = list(distinct.values())[: SCORED * PRECISE]
        best = self.posterior.best.fit
        hopeless = best.misfit + MISSED * price
        # As long as the nominal plant is the best hypothesis, no fit is hopeless.
        near = [fit for fit in ranked[:PRECISE] if fit.misfit <= hopeless or not best.effects]
        self._settle(near)
        self._add([fit for fit in ranked if fit not in near])

    # Restarts

    def _restart(self) -> None:
        """Fit the best hypotheses from other values and at other components.

        Stick-slip gives the misfit several minima. An effect that was fitted alone may have settled
        in the minimum that belongs to another effect.
        """
        leaders = self._ranked_fits()[: self.thresholds.leaders]
        coarse, known = self.coarse, self.pool.keys()
        restarts = self.threads.spread(lambda fit: start_otherwise(coarse, fit), leaders)
        starts = [start for restart in restarts for start in restart]
        for fit in leaders[:1]:
            starts += start_elsewhere(coarse, fit, self._searched, known)
        self._keep(self._refine(starts))
        for fit in self._choose_beginnings():
            self._extend(fit)

    def _choose_beginnings(self) -> list[Fit]:
        """Choose single effects from which the search begins again.

        They are the best ones that were not extended yet, and the best regular ones at the values
        with which the forces along the measured motion balance. The best single effect and its
        extensions may resemble two other effects together. The misfit of a free joint may have
        several minima in one value.
        """
        singles = sorted(
            (scored.fit for effects, scored in self.pool.items() if len(effects) == 1),
            key=lambda fit: fit.misfit,
        )
        fresh = [fit for fit in singles if frozenset(fit.effects) not in self._extended]
        regular = [fit for fit in singles[: 2 * BEGINNINGS] if fit.effects[0].kind.name in REGULAR]
        balanced = [start for fit in regular for start in start_balanced(self.coarse, fit.effects)]
        return [*self._refine(balanced), *fresh[:BEGINNINGS]]


def _rank(scored: Scored) -> tuple[bool, float]:
    """Return the order of minima of one set of effects: bounded ones last, then by misfit."""
    return scored.bounded, scored.fit.misfit
