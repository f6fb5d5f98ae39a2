"""The simplest explanation that predicts data held out of its fit as well as any other does.

Of a machine whose nominal values are only a start something is always left, and how much better one
explanation fits says little. So each is judged on stretches of the recordings that its values were
not taken from; every recording counts alike, whatever its noise or length; and of explanations that
do as well as the best, the one with the fewest parameters is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from rigtwin.components import Effect, measures
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.finding import Support
from rigtwin.diagnosis.fit import Fit, Values, is_possible, without_each
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.held_out_judge import HeldOutJudge, Judged
from rigtwin.diagnosis.proposals import propose_replacements
from rigtwin.diagnosis.ranking import LATE
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import SelectionRules
from rigtwin.numerics.arrays import Array

SHAKES, SHAKEN, PRICE = (0.6, 1.6), 2, 0.1
"""Shares of a magnitude from which explanations are fitted again, how many of them, and at what
price of a parameter they are the foremost."""
ROUNDS = 5
"""Times that an explanation is chosen and its neighbours are judged too."""
JUDGED = 4
"""Explanations of each number of parameters that are judged at first."""
ROUNDING = 1e-6
"""Difference of two sizes that is none."""


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
"""Kinds that few machines have; what is left of other friction may be taken for them."""


@dataclass(frozen=True)
class Selection:
    """What was chosen of everything judged. alike: others that do as well, of the same number of
    effects, the best first; pool: all judged, the best first; price: of a parameter; nominal: the
    plant without any effect."""

    chosen: Judged
    alike: tuple[Judged, ...]
    pool: tuple[Judged, ...]
    price: float
    nominal: Plant
    rules: SelectionRules

    def support(self, effect: Effect) -> Support:
        """What speaks for one of the chosen effects."""
        place = self.chosen.fit.effects.index(effect)
        there = effect.nominal(self.nominal)[effect.kind.parameters[0]]
        width = max(self.chosen.widths[place][0], 1e-300)
        return Support(
            margin=_margin(
                effect,
                self.chosen,
                _list_rivals(
                    self.chosen, drop_unlikely(self.pool, self.rules), self.nominal, self.rules
                ),
                self.price,
                self.rules,
            ),
            steadiness=abs(self.chosen.fit.values[place][0] - there) / width,
            left=math.exp(self.chosen.score),
        )

    def half_widths(self, effect: Effect) -> tuple[float, ...]:
        """What the interval of each parameter of a chosen effect has to either side at least: by
        the jackknife, by the share of the signals that is left unexplained, and by what other
        explanations that do as well make of it."""
        place = self.chosen.fit.effects.index(effect)
        left = math.exp(self.chosen.score)
        found = self.chosen.fit.values[place]
        others = [
            each.fit.values[each.fit.effects.index(effect)]
            for each in self.pool
            if effect in each.fit.effects
            and each.score <= self.chosen.score + self.rules.alike
            and not each.doubtful
            and not each.bounded
        ]
        return tuple(
            max(
                self.rules.jackknifed * width,
                left * abs(value),
                *(abs(other[number] - value) for other in others),
            )
            for number, (width, value) in enumerate(
                zip(self.chosen.widths[place], found, strict=True)
            )
        )

    def replace_chosen(self, fit: Fit) -> Selection:
        """The same with other values of the chosen effects."""
        chosen = replace(self.chosen, fit=fit)
        pool = tuple(chosen if each is self.chosen else each for each in self.pool)
        return replace(self, chosen=chosen, pool=pool)

    def beside(self, errors: Callable[[Fit], Array]) -> Selection:
        """What is chosen where further recordings count as much as those that were fitted.

        Nothing of more parameters than before: what the search did not ask for is no finding.

        Parameters
        ----------
        errors
            What a fit leaves of each of them, in units of the signals' own, shape (recordings,).
        """
        pool = [
            each.beside(errors(each.fit))
            for each in self.pool
            if each is self.chosen or each.size <= self.chosen.size
        ]
        return conclude(pool, self.nominal, self.rules)

    def without(self, judged: Judged) -> Selection:
        """What is chosen if one explanation stands at a bound."""
        pool = [replace(each, bounded=True) if each is judged else each for each in self.pool]
        return conclude(pool, self.nominal, self.rules)


def choose(pool: Sequence[Judged], plant: Plant, rules: SelectionRules) -> Judged:
    """The explanation that does best at a price for each parameter.

    Parameters
    ----------
    pool
        All that were judged, the empty one among them.
    plant
        Without any effect.
    rules
        What "as well" means.

    Returns
    -------
    Judged
        One whose effects do not undo each other, and whose magnitudes are known.
    """
    fair = [
        each
        for each in pool
        if not each.doubtful and not each.bounded and _is_steady(each, plant, rules)
    ]
    price = rules.price_of(max(each.pieces for each in fair))
    likely = drop_unlikely(pool, rules)

    def least_margin(each: Judged) -> float:
        """Of its effects; infinite of none."""
        rivals = _list_rivals(each, likely, plant, rules)
        margins = (_margin(effect, each, rivals, price, rules) for effect in each.fit.effects)
        return min(margins, default=math.inf)

    margins = [(each, least_margin(each)) for each in _keep_simplest(fair, likely)]
    necessary = [each for each, margin in margins if margin >= rules.necessary]
    best = min(necessary or [each for each, _ in margins], key=lambda each: _cost(each, price))
    # Nothing is given up for what does far worse, only because one of its effects is in doubt.
    doubted = [
        each
        for each, margin in margins
        if margin > 0.0 and _cost(each, price) < _cost(best, price) - rules.least
    ]
    return min(doubted, key=lambda each: _cost(each, price), default=best)


def _keep_simplest(fair: Sequence[Judged], likely: Sequence[Judged]) -> list[Judged]:
    """Those of both; where some leave nothing but noise, the simplest of these: however little more
    another leaves, nothing asks for it."""
    kept = [each for each in fair if each in likely]
    sufficient = [each for each in kept if each.complete]
    least = min((each.size for each in sufficient), default=math.inf)
    return [each for each in sufficient if each.size < least + ROUNDING] or kept


def tell_apart(pool: Sequence[Judged], plant: Plant, rules: SelectionRules) -> list[Judged]:
    """The pool, with effects taken as told apart, however alike their responses, where the same
    explanation was tried without any one of them and does much worse; arguments as of `choose`."""
    price = rules.price_of(max(each.pieces for each in pool))
    tried = {frozenset(each.fit.effects): each for each in pool}

    def is_missed(effect: Effect, each: Judged) -> bool:
        rest = tuple(own for own in each.fit.effects if own != effect)
        if is_possible(rest, plant) and frozenset(rest) not in tried:
            return False
        fewer = [other for effects, other in tried.items() if effects <= set(rest)]
        least = min((_cost(other, price) for other in fewer), default=-math.inf)
        return least >= _cost(each, price) + rules.apart

    return [
        replace(each, collinear=False)
        if each.collinear and all(is_missed(effect, each) for effect in each.fit.effects)
        else each
        for each in pool
    ]


def _is_steady(each: Judged, plant: Plant, rules: SelectionRules) -> bool:
    """Whether all magnitudes of an explanation are known."""
    nominal = [e.nominal(plant)[e.kind.parameters[0]] for e in each.fit.effects]
    return each.is_stable(nominal, rules.steady)


def _list_rivals(
    explanation: Judged, likely: Sequence[Judged], plant: Plant, rules: SelectionRules
) -> list[Judged]:
    """Those that an explanation must do better than: a larger one only if its magnitudes are known,
    as enough parameters whose values nobody knows do as well as anything."""
    return [
        each for each in likely if each.size <= explanation.size or _is_steady(each, plant, rules)
    ]


def drop_unlikely(pool: Sequence[Judged], rules: SelectionRules) -> list[Judged]:
    """The explanations that can be rivals of each other.

    Parameters
    ----------
    pool
        All that were judged, the empty one among them.
    rules
        What is possible, and likely.

    Returns
    -------
    list of Judged
        Those whose effects do not undo each other or stand at a bound, and in which everything that
        few machines have accounts for a good share of the signals, or for all that is left.
    """
    possible = [each for each in pool if not each.doubtful and not each.bounded]

    def is_likely(effect: Effect, each: Judged) -> bool:
        others = set(each.fit.effects) - {effect}
        rival = min(
            other.score
            for other in possible
            if all(own in others or not _is_rare(own) for own in other.fit.effects)
        )
        share = math.exp(2.0 * rival) - math.exp(2.0 * each.score)
        far = rules.far_and_complete if each.complete else rules.far
        return share >= rules.rarely**2 or rival - each.score >= far

    return [
        each
        for each in possible
        if all(is_likely(effect, each) for effect in each.fit.effects if _is_rare(effect))
    ]


def _cost(each: Judged, price: float) -> float:
    return each.score + price * each.size


def _margin(
    effect: Effect,
    explanation: Judged,
    rivals: Sequence[Judged],
    price: float,
    rules: SelectionRules,
) -> float:
    """By how much everything without an effect, and without what it may be taken for, does worse
    than an explanation with it, price included."""
    own = set(explanation.fit.effects)

    def stands_in(each: Judged) -> bool:
        other = set(each.fit.effects)
        return (
            len(own - other) == len(other - own) == 1
            and abs(each.score - explanation.score) <= rules.alike
        )

    costs = (
        _cost(each, price)
        for each in rivals
        if not any(_is_one_of_a_sort(effect, other) for other in each.fit.effects)
        and not stands_in(each)
    )
    return min(costs) - _cost(explanation, price)


def _is_one_of_a_sort(effect: Effect, other: Effect) -> bool:
    """Whether one is the other, or both make a signal late."""
    return effect == other or (
        effect.component == other.component and effect.kind.name in LATE and other.kind.name in LATE
    )


def _is_rare(effect: Effect) -> bool:
    """Whether few machines have it."""
    if measures(effect.of()):
        return effect.kind.name != "offset"
    return effect.kind.name in RARE


def _is_as_good(each: Judged, best: Judged, slack: float, most: float) -> bool:
    behind = each.score - best.score
    return behind <= min(max(slack, each.uncertainty_against(best)), most)


def select(
    tried: Sequence[Fit],
    coarse: Fitter,
    judge: HeldOutJudge,
    effects: Sequence[Effect],
    threads: Threads,
) -> Selection:
    """Chooses among explanations, and judges those next to the one that is chosen.

    Parameters
    ----------
    tried
        Fits of any effects, the empty one among them.
    coarse
        Of coarse evidence, that fitted each effect alone.
    judge
        Of fits to the evidence.
    effects
        Candidates.
    threads
        Runs fits side by side.

    Returns
    -------
    Selection
        The simplest explanation that does as well as any.
    """
    fitter, rules = judge.fitter, judge.rules
    pool = {
        frozenset(each.fit.effects): each for each in threads.spread(judge.judge, _foremost(tried))
    }
    tried_starts: set[tuple[tuple[Effect, ...], Values]] = set()
    for _ in range(ROUNDS):
        chosen = choose(tell_apart(list(pool.values()), fitter.plant, rules), fitter.plant, rules)
        best = min(pool.values(), key=lambda each: each.score)
        simple = sorted(pool.values(), key=lambda each: each.score + PRICE * each.size)
        near = [pair for each in simple[:SHAKEN] for pair in _shake(each.fit, fitter)]
        near += [
            (rest, values)
            for each in (chosen, best)
            for _, rest, values in without_each(each.fit)
            if is_possible(rest, fitter.plant)
        ]
        if chosen.fit.effects:
            near += propose_replacements(coarse, chosen.fit, effects, threads)
        fresh = [pair for pair in dict.fromkeys(near) if pair not in tried_starts]
        if not fresh:
            break
        tried_starts.update(fresh)
        fits: dict[frozenset[Effect], Fit] = {}
        for fit in threads.map(lambda pair: fitter.refine(*pair), fresh):
            known = fits.setdefault(frozenset(fit.effects), fit)
            if fit.misfit < known.misfit:
                fits[frozenset(fit.effects)] = fit
        for judged in threads.spread(judge.judge, fits.values()):
            pool[frozenset(judged.fit.effects)] = judged
    return conclude(list(pool.values()), fitter.plant, rules)


def conclude(pool: Sequence[Judged], plant: Plant, rules: SelectionRules) -> Selection:
    """What is chosen of everything judged, and what does as well; arguments as of `choose`."""
    pool = tell_apart(pool, plant, rules)
    chosen = choose(pool, plant, rules)
    ranked = sorted(pool, key=lambda each: each.score)
    alike = tuple(
        each
        for each in ranked
        if each is not chosen
        and len(each.fit.effects) == len(chosen.fit.effects)
        and not each.doubtful
        and not each.bounded
        and _is_as_good(each, chosen, rules.alike, rules.slack)
    )
    price = rules.price_of(max(each.pieces for each in ranked))
    return Selection(chosen, alike, tuple(ranked), price, plant, rules)


def _shake(fit: Fit, fitter: Fitter) -> list[tuple[tuple[Effect, ...], Values]]:
    """A fit from other magnitudes: what sticks and slips has more than one best place."""
    found = []
    for number, (effect, values) in enumerate(zip(fit.effects, fit.values, strict=True)):
        nominal = effect.nominal(fitter.plant)[effect.kind.parameters[0]]
        for share in SHAKES:
            moved = (nominal + share * (values[0] - nominal), *values[1:])
            found.append((fit.effects, (*fit.values[:number], moved, *fit.values[number + 1 :])))
    return found


def _foremost(tried: Sequence[Fit]) -> list[Fit]:
    """The best fits of each number of parameters."""
    sizes: dict[int, list[Fit]] = {}
    seen: set[frozenset[Effect]] = set()
    for fit in sorted(tried, key=lambda each: each.misfit):
        size = sum(len(effect.kind.parameters) for effect in fit.effects)
        own = sizes.setdefault(size, [])
        if frozenset(fit.effects) not in seen and len(own) < JUDGED:
            own.append(fit)
            seen.add(frozenset(fit.effects))
    return [fit for own in sizes.values() for fit in own]
