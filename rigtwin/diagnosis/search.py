"""The search for hypotheses: every effect alone, then sets of effects, one step at a time.

1. Screen: each effect is tried at several values, and its linearised promise is noted.
2. Fit the promising effects alone, and the regular ones (friction, mass, stiffness) together.
3. Extend the best hypotheses by one effect; replace each of their effects by those that resemble
   it; leave each out. Repeat as long as a better hypothesis is found.
4. Where much is left, try other values, and the same kinds at other components.

A hypothesis is fitted on coarse evidence (half the integration steps, thinned where the model can
do without), and scored on fine evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook, look_first
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.posterior import Posterior
from rigtwin.diagnosis.proposals import choose_distinct, propose_additions, propose_replacements
from rigtwin.diagnosis.regulars import choose_regulars, fit_together, start_balanced
from rigtwin.diagnosis.scoring import Scored, Scorer
from rigtwin.diagnosis.starts import (
    GATEWAY,
    REGULAR,
    Start,
    start_elsewhere,
    start_in_series,
    start_merged,
    start_otherwise,
    start_regular_instead,
    start_unfolded,
)
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import Thresholds

SETTLED = 6
"""Single effects that are fitted precisely."""
PRECISE, SCORED = 2, 4
"""Neighbours of a leader that are fitted precisely, and times as many that are scored."""
AHEAD = 1
"""Effects that a hypothesis may have more than the best one and still be extended."""
BEHIND = 0.5
"""Share of what the best hypothesis explains that another may lack and still be extended."""
MISSED = 10.0
"""Prices of an effect whose loss is worth a fit without it."""
VARIED, COMPARED = 2, 5
"""Effects that are tried in the place of each while the search climbs, and of its result."""
BEGINNINGS = 4
"""Single effects that are extended where the best hypothesis leaves much."""
STEADY_ROUNDS = 2
"""Rounds without a better hypothesis after which the search ends."""


@dataclass
class Search:
    """A search on one body of evidence.

    Parameters
    ----------
    evidence
        The recordings about the nominal plant.
    effects
        Candidates.
    thresholds
        Numbers that the search goes by.
    threads
        Threads that fit side by side.
    on_first_look
        Called once all effects were tried, before any is fitted.
    """

    evidence: Evidence
    effects: Sequence[Effect]
    thresholds: Thresholds
    threads: Threads
    on_first_look: Callable[[FirstLook], object] = lambda _: None
    pool: dict[frozenset[Effect], Scored] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        searched = self.evidence.thin()
        self.coarse = Fitter(searched.halve_steps())
        self.fine = Fitter(searched)
        self._scorer = Scorer(self.fine)
        self._extended: set[frozenset[Effect]] = set()
        self._tried: set[Start] = set()
        self.screened: list[Screened] = []

    @property
    def posterior(self) -> Posterior:
        """Weights of all that was tried so far."""
        return Posterior(list(self.pool.values()), self.fine, len(self.effects), self.thresholds)

    def run(self) -> Posterior:
        """Search.

        Returns
        -------
        Posterior
            All hypotheses that were tried, with their weights.
        """
        singles = self._fit_singles()
        if self._has_gap(singles):
            # The cheapest single effect may explain one signal alone. The one that leaves least of
            # all signals is extended too, and so is dry friction: where it acts through a spring or
            # a play, it explains little by itself.
            through = [fit for fit in singles if fit.effects[0].kind.name == GATEWAY]
            for fit in (singles[0], *through[:1]):
                if self.posterior.leaves_something and frozenset(fit.effects) not in self._extended:
                    self._extend(fit)
            self._climb()
            if (
                self.posterior.leaves_something
                or len(self.posterior.best.fit.effects) > 1
                or self._swings_freely()
            ):
                self._fit_regulars()
                self._climb()
            if self.posterior.leaves_something:
                self._restart()
                self._climb()
            self._vary_best()
        return self.posterior

    # Single effects

    def _fit_singles(self) -> list[Fit]:
        """Fit the nominal plant and each promising effect alone."""
        self.screened = self.threads.map(self.coarse.screen, self.effects)
        nothing = self.fine.refit_with_tolerances(self.fine.nominal_fit)
        self._add([nothing])
        limit = self.posterior.prices.ordinary
        self.on_first_look(look_first(self.coarse, self.screened, 2.0 * limit, self.thresholds))
        most = max((each.promise for each in self.screened), default=0.0)
        worth = self.thresholds.promising_share * max(most, 2.0 * limit)
        promising = [each for each in self.screened if each.promise >= worth]
        singles = sorted(self.threads.map(self._fit_single, promising), key=lambda f: f.misfit)
        if singles:
            gain = max(self.coarse.nominal_fit.misfit - singles[0].misfit, 0.0)
            near = singles[0].misfit + self.thresholds.precise_fit_shortfall * gain + 4.0 * limit
            # A hypothesis far behind stays there, however the tolerances are taken.
            settled = [fit for fit in singles[:SETTLED] if fit.misfit <= near]
            self._settle(settled)
            self._add([fit for fit in singles[: 2 * SETTLED] if fit not in settled])
        return singles

    def _fit_single(self, screened: Screened) -> Fit:
        """Fit an effect alone; where a joint swings freely, also from what its forces take."""
        fit = self.coarse.fit_one(screened)
        if screened.effect.kind.name in REGULAR:
            others = [
                self.coarse.refine(*start)
                for start in start_balanced(self.coarse, (screened.effect,))
            ]
            fit = min(fit, *others, key=lambda each: each.misfit) if others else fit
        return fit

    def _swings_freely(self) -> bool:
        """Whether a joint goes by itself, so that a single effect may fit at more than one value,
        and one effect may pass for another."""
        return self.coarse.evidence.missing_force(self.coarse.plant) is not None

    def _has_gap(self, singles: Sequence[Fit]) -> bool:
        """Whether anything is worth more than its price, or the rest is more than noise."""
        posterior = self.posterior
        return bool(posterior.best.fit.effects) or (
            bool(singles)
            and (
                self.coarse.nominal_fit.misfit - singles[0].misfit > 2.0 * posterior.prices.ordinary
                or posterior.rest > self.thresholds.residual_excess
            )
        )

    # The pool

    def _add(self, fits: Sequence[Fit]) -> None:
        """Score fits; of each set of effects the best fit is kept."""
        for scored in self.threads.spread(self._scorer.score, fits):
            key = frozenset(scored.fit.effects)
            known = self.pool.get(key)
            if known is None or scored.fit.misfit < known.fit.misfit:
                self.pool[key] = scored

    def _settle(self, fits: Sequence[Fit]) -> None:
        """Fit with the tolerances taken at the fit, on fine evidence, and score."""
        self._add(self.threads.map(self.fine.refit_with_tolerances, fits))

    # Sets of effects

    def _fit_regulars(self) -> None:
        """Fit what nearly every machine has together, and sets of it with fewer effects."""
        price = self.posterior.prices.ordinary
        chosen = choose_regulars(self.effects, self.screened, price)
        if len(chosen) > 1:
            whole, reduced = fit_together(self.coarse, chosen, 2.0 * price, self.threads)
            self._keep([whole, *self._refine(reduced)])

    def _climb(self) -> None:
        """Extend the best hypotheses by one effect as long as better ones are found; where that
        fails, vary them."""
        steady = 0
        while steady < STEADY_ROUNDS:
            before = self.posterior.best
            if (leader := self._next_leader()) is None:
                return
            self._extend(leader)
            if not self._improved(before):
                if not self.posterior.leaves_something:
                    return
                self._vary(leader, VARIED)
            steady = 0 if self._improved(before) else steady + 1

    def _improved(self, before: Scored) -> bool:
        """Whether the best hypothesis is better than another by more than a tie."""
        posterior = self.posterior
        return posterior.ranking[0].cost < posterior.cost(before) - 0.5 * posterior.temper

    def _next_leader(self) -> Fit | None:
        """The best hypothesis that was not extended yet, or the best with dry friction."""
        ranked = [each.scored.fit for each in self.posterior.ranking if math.isfinite(each.cost)]
        ranked = [fit for fit in ranked if fit.effects]
        if not ranked:
            return None
        # A hypothesis that explains much less than the best one leads nowhere.
        nothing, best = self.pool[frozenset()].fit.misfit, min(fit.misfit for fit in ranked)
        most = best + BEHIND * max(nothing - best, 0.0)
        longest = len(ranked[0].effects) + AHEAD
        near = [fit for fit in ranked if fit.misfit <= most and len(fit.effects) <= longest]
        through = [f for f in near if any(e.kind.name == GATEWAY for e in f.effects)]
        # A step on the way may not be worth its price yet: the closest fits lead on as well.
        closest = sorted(near, key=lambda fit: fit.misfit)
        leaders = (ranked[0], *closest[:1], *near[: self.thresholds.leaders], *through[:1])
        for fit in leaders:
            if frozenset(fit.effects) not in self._extended:
                return fit
        return None

    def _extend(self, leader: Fit) -> None:
        """Fit a hypothesis with one more effect."""
        self._extended.add(frozenset(leader.effects))
        limit = self.posterior.prices.ordinary
        proposals = choose_distinct(
            propose_additions(self.coarse, leader, self.effects, 2.0 * limit, self.threads),
            self.thresholds.additions,
        )
        fits = self.threads.map(
            lambda each: self.coarse.refine(each.effects, each.values, each.space), proposals
        )
        if self.posterior.leaves_something:
            fits += self._refine(
                [
                    *start_in_series(self.coarse, leader, self.effects, self.pool.keys()),
                    *start_unfolded(self.coarse, leader, self.effects),
                ]
            )
        self._keep(fits)

    def _vary(self, leader: Fit, count: int) -> None:
        """Fit a hypothesis with each effect left out, and with each replaced by so many others that
        resemble it."""
        limit = 2.0 * self.posterior.prices.ordinary
        starts: list[Start] = []
        if len(leader.effects) > 1:
            # An effect whose loss costs far more than its price is not worth a fit without it.
            starts += [
                (rest, values)
                for misfit, rest, values in Linearised(self.coarse, leader).leave_out_each()
                if misfit - leader.misfit < MISSED * limit
            ]
        starts += propose_replacements(self.coarse, leader, self.effects, count, self.threads)
        starts += start_regular_instead(self.coarse, leader, self.effects)
        starts += start_merged(leader)
        self._keep(self._refine(starts))

    def _vary_best(self) -> None:
        """Look for rivals of the best hypothesis, until it stays the best."""
        best_fit = self.posterior.best.fit
        self._keep(self._refine(start_unfolded(self.coarse, best_fit, self.effects)))
        varied: set[frozenset[Effect]] = set()
        while len(best := self.posterior.best.fit.effects) > 1 and frozenset(best) not in varied:
            varied.add(frozenset(best))
            self._vary(self.posterior.best.fit, COMPARED)

    def _refine(self, starts: Sequence[Start]) -> list[Fit]:
        """Fit from starts that were not tried before."""
        fresh = [start for start in dict.fromkeys(starts) if start not in self._tried]
        self._tried.update(fresh)
        return self.threads.map(lambda start: self.coarse.refine(*start), fresh)

    def _keep(self, fits: Sequence[Fit]) -> None:
        """Settle the most promising of some coarse fits of each size, and score all others."""
        if not fits:
            return
        price = 2.0 * self.posterior.prices.ordinary
        distinct: dict[frozenset[Effect], Fit] = {}
        for fit in sorted(fits, key=lambda fit: fit.misfit + price * len(fit.effects)):
            distinct.setdefault(frozenset(fit.effects), fit)
        ranked = list(distinct.values())[: SCORED * PRECISE]
        best = self.posterior.best.fit
        hopeless = best.misfit + MISSED * price
        near = [fit for fit in ranked[:PRECISE] if fit.misfit <= hopeless or not best.effects]
        self._settle(near)
        self._add([fit for fit in ranked if fit not in near])

    # Where much is left

    def _restart(self) -> None:
        """Fit the best hypotheses from other values and at other components.

        Stick-slip has more than one best place, and the values of the first effect alone may lie in
        the valley of another.
        """
        leaders = [each.scored.fit for each in self.posterior.ranking if math.isfinite(each.cost)]
        leaders = [fit for fit in leaders if fit.effects][: self.thresholds.leaders]
        coarse, known = self.coarse, self.pool.keys()
        again = self.threads.spread(lambda fit: start_otherwise(coarse, fit), leaders)
        starts = [start for each in again for start in each]
        for fit in leaders[:1]:
            starts += start_elsewhere(coarse, fit, self.effects, known)
        self._keep(self._refine(starts))
        for fit in self._choose_beginnings():
            self._extend(fit)

    def _choose_beginnings(self) -> list[Fit]:
        """Choose the best single effects that were not extended yet, and the same where the forces
        along the measured motion put them.

        What explains most alone, and what was found beside it, may resemble two others together;
        and a joint that swings freely has more than one best place for a single effect.
        """
        singles = sorted(
            (scored.fit for effects, scored in self.pool.items() if len(effects) == 1),
            key=lambda fit: fit.misfit,
        )
        fresh = [fit for fit in singles if frozenset(fit.effects) not in self._extended]
        regular = [fit for fit in singles[: 2 * BEGINNINGS] if fit.effects[0].kind.name in REGULAR]
        balanced = [start for fit in regular for start in start_balanced(self.coarse, fit.effects)]
        return [*self._refine(balanced), *fresh[:BEGINNINGS]]
