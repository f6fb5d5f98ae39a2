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
from itertools import combinations, product

from rigtwin.components import Effect, Guide, measures
from rigtwin.diagnosis.balance import balance_forces
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook, look_first
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, with_values, without_each
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.posterior import Posterior, is_rare
from rigtwin.diagnosis.proposals import propose_additions, propose_replacements
from rigtwin.diagnosis.scoring import Scored, Scorer
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
REGULAR = ("coulomb", "viscous", "stiffness", "mass", "armature", "offset")
"""Kinds that nearly every machine has more or less of."""
GATEWAY = "coulomb"
"""Kind without which a play, a spring or a Stribeck peak in series with it does nothing."""
IN_SERIES = ("compliance", "backlash")
"""Kinds in series with dry friction that hide it."""
GATEWAY_STARTS = 3
"""Sizes of the gateway from which regular effects are fitted together."""
FEW_REGULAR = 6
"""Regular effects up to which all of these sizes are tried."""
ELIMINATED = 4
"""Sets that are fitted of those from which one regular effect after another was left out."""
SECOND_ORDER = ("two_lags", "resonance")
"""Kinds that a lag together with a delay resembles."""
COMBINATIONS, FOLLOWED = 150, 2
"""Combinations of starts that are tried of one hypothesis at most, and those that are fitted."""
VARIED, COMPARED = 2, 5
"""Effects that are tried in the place of each while the search climbs, and of its result."""
STEADY_ROUNDS = 2
"""Rounds without a better hypothesis after which the search ends."""
Start = tuple[tuple[Effect, ...], Values]
"""Effects, and the values that a fit starts from."""


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
            self._climb()
            if self._leaves_something(self.posterior) or len(self.posterior.best.fit.effects) > 1:
                self._fit_regulars()
                self._climb()
            if self._leaves_something(self.posterior):
                self._restart()
                self._climb()
            self._vary_best()
        return self.posterior

    # Single effects

    def _fit_singles(self) -> list[Fit]:
        """Fit the nominal plant and each promising effect alone."""
        self.screened = self.threads.map(self.coarse.screen, self.effects)
        nothing = self.fine.refit_with_tolerances(self.fine.nothing)
        self._add([nothing])
        limit = self.posterior.price_for_one()
        self.on_first_look(look_first(self.coarse, self.screened, 2.0 * limit, self.thresholds))
        most = max((each.promise for each in self.screened), default=0.0)
        worth = self.thresholds.promising * max(most, 2.0 * limit)
        promising = [each for each in self.screened if each.promise >= worth]
        singles = sorted(
            self.threads.map(self.coarse.fit_one, promising), key=lambda fit: fit.misfit
        )
        if singles:
            gain = max(self.coarse.nothing.misfit - singles[0].misfit, 0.0)
            near = singles[0].misfit + self.thresholds.near * gain + 4.0 * limit
            # A hypothesis far behind stays there, however the tolerances are taken.
            self._settle([fit for fit in singles[:SETTLED] if fit.misfit <= near])
            self._add(singles[SETTLED : 2 * SETTLED])
        return singles

    def _has_gap(self, singles: Sequence[Fit]) -> bool:
        """Whether anything is worth more than its price, or the rest is more than noise."""
        posterior = self.posterior
        return bool(posterior.best.fit.effects) or (
            bool(singles)
            and (
                self.coarse.nothing.misfit - singles[0].misfit > 2.0 * posterior.price_for_one()
                or posterior.rest > self.thresholds.rest
            )
        )

    def _leaves_something(self, posterior: Posterior) -> bool:
        """Whether the rest of the best hypothesis could pay for one more effect."""
        return posterior.unexplained > posterior.price_for_one()

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
        """Fit what nearly every machine has together, and then leave out one after another.

        What is found one by one may stand for several of them at once.
        """
        chosen = self._choose_regulars()
        if len(chosen) < 2:
            return
        coarse = self.coarse

        def start_of(effect: Effect, number: int) -> tuple[float, ...]:
            if effect.kind.name != GATEWAY:
                return tuple(effect.nominal(coarse.plant).values())
            values = [v for v in coarse.starts(effect).values if v[0] > 0.0]
            return values[min(number, len(values) - 1)]

        count = GATEWAY_STARTS if len(chosen) <= FEW_REGULAR else 1
        starts: list[Values] = [
            tuple(start_of(effect, number) for effect in chosen) for number in range(count)
        ]
        if (balanced := balance_forces(coarse, chosen)) is not None:
            starts.append(balanced)
        tries = self.threads.map(lambda values: coarse.refine(tuple(chosen), values), starts)
        whole = min(tries, key=lambda fit: fit.misfit)
        price = 2.0 * self.posterior.price_for_one()
        path = sorted(coarse.eliminate(whole), key=lambda each: each[0] + price * len(each[1]))
        fits = self.threads.map(lambda each: coarse.refine(*each[1:]), path[:ELIMINATED])
        self._keep([whole, *fits])

    def _choose_regulars(self) -> list[Effect]:
        """Regular effects that promise anything, at every component that can have them."""
        worth = self.posterior.price_for_one()
        promise = {each.effect: each.promise for each in self.screened}
        coupled = len({e.group for e in self.effects if e.of is Guide}) > 1
        chosen: dict[tuple[str, str], Effect] = {}
        for effect in self.effects:
            name = effect.kind.name
            if measures(effect.of()):
                continue
            if name in REGULAR and (promise[effect] > worth or name == GATEWAY):
                at = effect.group if coupled and effect.of is Guide else ""
                chosen.setdefault((name, at), effect)
        return list(chosen.values())

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
                if not self._leaves_something(self.posterior):
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
        limit = self.posterior.price_for_one()
        proposals = sorted(
            propose_additions(self.coarse, leader, self.effects, 2.0 * limit, self.threads),
            key=lambda proposal: proposal.promised,
        )[: self.thresholds.additions]
        fits = self.threads.map(
            lambda each: self.coarse.refine(each.effects, each.values, each.space), proposals
        )
        if self._leaves_something(self.posterior):
            fits += self._refine([*self._series_starts(leader), *self._unfold(leader)])
        self._keep(fits)

    def _vary(self, leader: Fit, count: int) -> None:
        """Fit a hypothesis with each effect left out, and with each replaced by so many others that
        resemble it."""
        limit = 2.0 * self.posterior.price_for_one()
        starts: list[Start] = []
        if len(leader.effects) > 1:
            # An effect whose loss costs far more than its price is not worth a fit without it.
            starts += [
                (rest, values)
                for misfit, rest, values in self.coarse.predict_without(leader)
                if misfit - leader.misfit < MISSED * limit
            ]
        starts += propose_replacements(self.coarse, leader, self.effects, count, self.threads)
        starts += self._regular_instead(leader)
        self._keep(self._refine(starts))

    def _regular_instead(self, leader: Fit) -> list[Start]:
        """Each rare effect replaced by the regular ones of its component, however unlike they are:
        what few machines have needs to be compared with what all have."""
        found: list[Start] = []
        for number, effect in enumerate(leader.effects):
            if not is_rare(effect):
                continue
            kept = (*leader.effects[:number], *leader.effects[number + 1 :])
            values = (*leader.values[:number], *leader.values[number + 1 :])
            for other in self.effects:
                if (
                    other.group == effect.group
                    and other.kind.name in REGULAR
                    and other not in kept
                    and not clashes(other, kept)
                    and is_possible((*kept, other), self.coarse.plant)
                ):
                    middle = self.coarse.starts(other).values
                    start = min(middle, key=lambda each: abs(each[0]))
                    found.append(((*kept, other), (*values, start)))
        return found

    def _vary_best(self) -> None:
        """Look for rivals of the best hypothesis, until it stays the best."""
        self._keep(self._refine(self._unfold(self.posterior.best.fit)))
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
        price = 2.0 * self.posterior.price_for_one()
        distinct: dict[frozenset[Effect], Fit] = {}
        for fit in sorted(fits, key=lambda fit: fit.misfit + price * len(fit.effects)):
            distinct.setdefault(frozenset(fit.effects), fit)
        ranked = list(distinct.values())[: SCORED * PRECISE]
        best = self.posterior.best.fit
        hopeless = best.misfit + MISSED * price
        near = [fit for fit in ranked[:PRECISE] if fit.misfit <= hopeless or not best.effects]
        self._settle(near)
        self._add([fit for fit in ranked if fit not in near])

    def _series_starts(self, leader: Fit) -> list[Start]:
        """Starts for pairs of dry friction and what is in series with it: friction behind a soft
        spring hardly resembles friction alone, nor does a play resemble one behind a spring."""
        found = []
        gates = [e for e in self.effects if e.kind.name == GATEWAY and e.of is Guide]
        for gate in gates:
            series = [gate] + [
                e for e in self.effects if e.group == gate.group and e.kind.name in IN_SERIES
            ]
            present = [effect for effect in series if effect in leader.effects]
            for pair in combinations(series, 2):
                rest = [
                    (effect, values)
                    for effect, values in zip(leader.effects, leader.values, strict=True)
                    if effect not in pair
                ]
                kept = tuple(effect for effect, _ in rest)
                wanted = gate in pair or gate in present
                known = frozenset((*kept, *pair)) in self.pool
                if wanted and not known and not any(clashes(each, kept) for each in pair):
                    found.append(self._pair_start(kept, tuple(v for _, v in rest), pair))
        return found

    def _pair_start(
        self, effects: Sequence[Effect], values: Values, pair: tuple[Effect, Effect]
    ) -> Start:
        """A pair of effects beside others, at the best of all pairs of their starts."""
        coarse, both = self.coarse, (*effects, *pair)
        one, two = (coarse.starts(effect).values for effect in pair)
        starts = [(*values, *start) for start in product(one, two)]
        residuals = (
            coarse.evidence.residual(with_values(coarse.plant, both, start)) for start in starts
        )
        return both, min(
            (coarse.space.misfit(residual), start)
            for residual, start in zip(residuals, starts, strict=True)
        )[1]

    def _unfold(self, leader: Fit) -> list[Start]:
        """Starts with a lag and a delay in the place of an effect of second order: they are alike
        at low frequencies."""
        found = []
        for effect, rest, values in without_each(leader):
            pair = [
                each
                for each in self.effects
                if each.group == effect.group and each.kind.name in ("lag", "delay")
            ]
            if (
                effect.kind.name in SECOND_ORDER
                and len(pair) == 2
                and not any(clashes(each, rest) for each in pair)
            ):
                found.append(self._pair_start(rest, values, (pair[0], pair[1])))
        return found

    # Where much is left

    def _restart(self) -> None:
        """Fit the best hypotheses from other values and at other components.

        Stick-slip has more than one best place, and the values of the first effect alone may lie in
        the valley of another.
        """
        leaders = [each.scored.fit for each in self.posterior.ranking if math.isfinite(each.cost)]
        leaders = [fit for fit in leaders if fit.effects][: self.thresholds.leaders]
        fits = [
            fit for each in self.threads.spread(self._from_other_values, leaders) for fit in each
        ]
        if leaders:
            fits += self.threads.map(
                lambda start: self.coarse.refine(*start), self._elsewhere(leaders[0])
            )
        self._keep(fits)

    def _from_other_values(self, fit: Fit) -> list[Fit]:
        coarse = self.coarse
        starts = [coarse.starts(effect).values for effect in fit.effects]
        if math.prod(len(each) for each in starts) > COMBINATIONS:
            return []
        scored = sorted(
            (
                coarse.space.misfit(
                    coarse.evidence.residual(with_values(coarse.plant, fit.effects, values))
                ),
                values,
            )
            for values in product(*starts)
        )
        return [coarse.refine(fit.effects, values) for _, values in scored[:FOLLOWED]]

    def _elsewhere(self, fit: Fit) -> list[Start]:
        """Each effect of a hypothesis in turn at every other component that may have it."""
        found = []
        for number, effect in enumerate(fit.effects):
            kept = (*fit.effects[:number], *fit.effects[number + 1 :])
            for other in self.effects:
                effects = (*fit.effects[:number], other, *fit.effects[number + 1 :])
                if (
                    other != effect
                    and other.kind == effect.kind
                    and not clashes(other, kept)
                    and is_possible(effects, self.coarse.plant)
                    and frozenset(effects) not in self.pool
                ):
                    found.append((effects, fit.values))
        return found
