"""Pairs of effects, where one is not enough: from the responses to each, then from other starts and
at other components where that leaves more than noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, with_values, without_each
from rigtwin.diagnosis.proposals import Proposal, propose_additions, propose_replacements
from rigtwin.diagnosis.ranking import within_tolerance
from rigtwin.diagnosis.search import Search

BEAM = 3
"""First effects to which a second is sought."""
MANY, FEW = 10, 3
"""Pairs fitted in full, where one effect leaves much and where it leaves little."""
LOOKED_AGAIN = 2
"""Times that the best pair's effects are replaced by what resembles them."""
RESTARTED, COMBINED, FOLLOWED = 6, 150, 2
"""Pairs that are fitted from other starts where the best leaves too much, combinations of starts
that are tried of one at most, and how many of these are followed."""
NEAR = 1.5
"""Times the best misfit up to which a pair is not fitted again from another start."""
SETTLED_PAIRS = 4
"""Pairs that are fitted again with the tolerances taken at them."""


def fit_pairs(search: Search, nothing: Fit, tried: Sequence[Fit]) -> list[Fit]:
    """Pairs of effects that explain enough of what the best one leaves.

    Parameters
    ----------
    search
        What it works with.
    nothing
        The nominal plant.
    tried
        Effects alone, the best first.

    Returns
    -------
    list of Fit
        The foremost are fitted with the tolerances taken at them.
    """
    evidence, thresholds, first = search.fitter.evidence, search.thresholds, tried[0]
    much = _excess(first.misfit, evidence) > thresholds.much * evidence.expected
    hopes: list[Proposal] = []
    for leader in tried[: BEAM if much else 1]:
        # What stands far behind as the first of two is no leader.
        if leader.misfit - first.misfit <= thresholds.far_behind * max(
            nothing.misfit - first.misfit, 0.0
        ):
            hopes += propose_additions(
                search.coarse, leader, search.effects, search.least, search.threads
            )
    hopes.sort(key=lambda hope: hope.promised)
    hopeful = _distinct(hopes)[: MANY if much else FEW]
    pairs = search.threads.map(
        lambda hope: search.coarse.refine(hope.effects, hope.values, hope.space), hopeful
    )
    pairs.sort(key=search.cost)
    enough = evidence.expected + thresholds.unexplained * evidence.expected
    for _ in range(LOOKED_AGAIN):
        pairs = _add(pairs, _replace, search)
    if pairs and pairs[0].misfit > enough:
        for step in (_restart, _move_elsewhere, _replace):
            pairs = _add(pairs, step, search)
    foremost = _foremost(pairs)
    settled = search.threads.map(search.fitter.refit_with_tolerances, foremost)
    others = [pair for pair in pairs if all(pair is not each for each in foremost)]
    parts = _fit_parts(search, settled)
    first = min([first, *parts], key=lambda fit: fit.misfit)
    least_more = max(
        thresholds.second * search.least,
        thresholds.known.more * _excess(first.misfit, evidence),
    )
    return parts + [
        pair
        for pair in (*settled, *others)
        if first.misfit - pair.misfit > least_more
        and not within_tolerance(pair, evidence, thresholds)
        and not search.fitter.has_shape_at_end(pair)
    ]


def _fit_parts(search: Search, pairs: Sequence[Fit]) -> list[Fit]:
    """Each effect of the best pair alone, from its value there: it may explain as much, though it
    promised little."""
    if not pairs:
        return []
    best = min(pairs, key=search.cost)
    return search.threads.map(
        lambda part: search.fitter.refit_with_tolerances(search.coarse.refine(part[1], part[2])),
        list(without_each(best)),
    )


def _add(
    pairs: list[Fit], step: Callable[[Search, Sequence[Fit]], list[Fit]], search: Search
) -> list[Fit]:
    """The pairs with those that a step finds, the best first."""
    return sorted([*pairs, *step(search, pairs)], key=search.cost) if pairs else pairs


def _foremost(pairs: Sequence[Fit]) -> list[Fit]:
    """The best pairs, and besides the best of other effects, where one pair has several valleys."""
    distinct: dict[frozenset[Effect], Fit] = {}
    for pair in pairs:
        distinct.setdefault(frozenset(pair.effects), pair)
    best = [*pairs[:SETTLED_PAIRS], *list(distinct.values())[:SETTLED_PAIRS]]
    return list({id(pair): pair for pair in best}.values())


def _near(pairs: Sequence[Fit]) -> set[frozenset[Effect]]:
    """Effects of the pairs that are not far behind the best; others may lie in a wrong valley."""
    return {frozenset(pair.effects) for pair in pairs if pair.misfit <= NEAR * pairs[0].misfit}


def _replace(search: Search, pairs: Sequence[Fit]) -> list[Fit]:
    """The best pair with its effects replaced by what resembles them."""
    known = _near(pairs)
    fresh = [
        pair
        for pair in propose_replacements(search.coarse, pairs[0], search.effects, search.threads)
        if frozenset(pair[0]) not in known
    ]
    return search.threads.map(lambda pair: search.coarse.refine(*pair), fresh)


def _restart(search: Search, pairs: Sequence[Fit]) -> list[Fit]:
    """The foremost pairs again, each from the best of all combinations of their starts: what sticks
    and slips has more than one best place, and the values of the first alone may lie in another's
    valley."""
    coarse = search.coarse

    def restart(pair: Fit) -> list[Fit]:
        starts = [coarse.starts(effect).values for effect in pair.effects]
        if math.prod(len(each) for each in starts) > COMBINED:
            return []
        scored = sorted(
            (
                coarse.space.misfit(
                    coarse.evidence.residual(with_values(coarse.plant, pair.effects, values))
                ),
                values,
            )
            for values in product(*starts)
        )
        return [coarse.refine(pair.effects, values) for _, values in scored[:FOLLOWED]]

    return [fit for each in search.threads.spread(restart, pairs[:RESTARTED]) for fit in each]


def _move_elsewhere(search: Search, pairs: Sequence[Fit]) -> list[Fit]:
    """The best pair with each of its effects in turn at every other component that may have it."""
    best, coarse, known = pairs[0], search.coarse, _near(pairs)
    moved = []
    for number, effect in enumerate(best.effects):
        for other in search.effects:
            kept = (*best.effects[:number], *best.effects[number + 1 :])
            effects = (*best.effects[:number], other, *best.effects[number + 1 :])
            if (
                other.kind == effect.kind
                and not clashes(other, kept)
                and is_possible(effects, coarse.plant)
                and frozenset(effects) not in known
            ):
                moved.append(effects)
    return search.threads.map(lambda effects: coarse.refine(effects, best.values), moved)


def _distinct(hopes: Sequence[Proposal]) -> list[Proposal]:
    """Each pair of effects once, however it was come by."""
    found: dict[frozenset[str], Proposal] = {}
    for hope in hopes:
        found.setdefault(frozenset(effect.name for effect in hope.effects), hope)
    return list(found.values())


def _excess(misfit: float, evidence: Evidence) -> float:
    return max(misfit - evidence.expected, 0.0)
