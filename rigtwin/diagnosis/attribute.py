"""Which effects explain the evidence: every candidate fitted, pairs where one is not enough, and
how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, Fitter, Proposal, with_values, without_each
from rigtwin.diagnosis.stepwise import (
    Growth,
    drop_needless,
    fit_stepwise,
    penalised_cost,
    within_tolerance,
)
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

THREADS = 2
"""That fit at a time: the compiled plants leave the interpreter free."""
REFITTED = 6
"""Explanations that are fitted again with the tolerances taken at them."""
BEAM = 3
"""First effects to which a second is sought."""
MANY, FEW = 10, 3
"""Pairs fitted in full, where one effect leaves much and where it leaves little."""
LOOKED_AGAIN = 2
"""Times that the best pair's effects are replaced by what resembles them."""
SETTLED_PAIRS = 4
"""Pairs that are fitted again with the tolerances taken at them."""


@dataclass(frozen=True)
class Explanation:
    """One way to explain the evidence. probability: of this one among all tried."""

    fit: Fit
    price: float
    probability: float

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(effect.name for effect in self.fit.effects)


@dataclass(frozen=True)
class Attribution:
    """nothing: misfit of the nominal twin; expected: χ² of noise alone; best: the explanation to be
    named, None for none; ranking: all tried, the likeliest first; explained: share of the gap;
    left: χ² per degree of freedom above 1 after it; unknown: whether what is left is a gap; shares:
    of the gap, of each effect named; silent: effects that no size tried makes noticeable on this
    evidence; chain: the fits as effects were found one after another, the first alone first."""

    nothing: Fit
    expected: float
    best: Explanation | None
    ranking: tuple[Explanation, ...]
    explained: float
    left: float
    unknown: bool
    shares: dict[str, float]
    silent: tuple[Effect, ...]
    chain: tuple[Fit, ...] = ()


def library(evidence: Evidence) -> list[Effect]:
    """The candidates that are searched for.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.

    Returns
    -------
    list of Effect
        Those that the machine can have and that are not read off a signal.
    """
    return [effect for effect in evidence.machine.effects() if effect.searched]


def attribute(
    evidence: Evidence,
    progress: Callable[[int], object] = lambda _: None,
    thresholds: Thresholds = STANDARD,
) -> Attribution:
    """Searches the whole library for what explains the evidence.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.
    progress
        Called with the number of fits done since its last call.
    thresholds
        What figures are held against.

    Returns
    -------
    Attribution
        Everything tried, and the explanation to be named.
    """
    least = detection_limit(evidence, thresholds)
    rules = thresholds.rough if evidence.machine.rough else thresholds.known
    cost = partial(penalised_cost, price=thresholds.price)
    search, fitter = Fitter(evidence.halve_steps()), Fitter(evidence)
    effects = library(evidence)
    with ThreadPoolExecutor(THREADS) as pool:

        def map_fits(function: Callable[..., Fit], items: Iterable[object]) -> list[Fit]:
            results = []
            try:
                for fit in pool.map(function, items):
                    results.append(fit)
                    progress(1)
            except BaseException:
                # Interrupted: what has not begun need not be done.
                pool.shutdown(wait=False, cancel_futures=True)
                raise
            return results

        singles = map_fits(search.fit_one, effects)
        singles.sort(key=cost)
        # Those far behind stay there, however the tolerances are taken.
        near = (
            singles[0].misfit
            + thresholds.near * max(search.nothing.misfit - singles[0].misfit, 0.0)
            + 2.0 * least
        )
        close = [fit for fit in singles[:REFITTED] if fit.misfit <= near]
        tried = map_fits(fitter.refit_with_tolerances, close) + singles[len(close) :]
        tried.sort(key=cost)
        first = tried[0]
        nothing = fitter.refit_with_tolerances(fitter.nothing)
        if nothing.misfit - cost(first) > least:
            much = _excess(first.misfit, evidence) > thresholds.much * evidence.expected
            hopes: list[Proposal] = []
            for leader in tried[: BEAM if much else 1]:
                # What stands far behind as the first of two is no leader.
                if leader.misfit - first.misfit <= thresholds.far_behind * max(
                    nothing.misfit - first.misfit, 0.0
                ):
                    hopes += search.propose_additions(leader, effects, least)
            hopes.sort(key=lambda hope: hope.promised)
            hopeful = _distinct(hopes)[: MANY if much else FEW]
            pairs = map_fits(
                lambda hope: search.refine(hope.effects, hope.values, hope.space), hopeful
            )
            pairs.sort(key=cost)
            for _ in range(LOOKED_AGAIN if pairs else 0):
                known = {frozenset(pair.effects) for pair in pairs}
                fresh = [
                    pair
                    for pair in search.propose_replacements(pairs[0], effects)
                    if frozenset(pair[0]) not in known
                ]
                pairs += map_fits(lambda pair: search.refine(*pair), fresh)
                pairs.sort(key=cost)
            pairs = (
                map_fits(fitter.refit_with_tolerances, pairs[:SETTLED_PAIRS])
                + pairs[SETTLED_PAIRS:]
            )
            least_more = max(
                thresholds.second * least, rules.more * _excess(first.misfit, evidence)
            )
            tried += [
                p
                for p in pairs
                if first.misfit - p.misfit > least_more
                and not within_tolerance(p, evidence, thresholds)
            ]
        chain = [fit for fit in drop_needless(tried, least, thresholds) if fit.effects][:1]
        if rules.most > thresholds.known.most:
            more, chain = fit_stepwise(
                tried, first, Growth(search, fitter, effects, least, rules, thresholds), map_fits
            )
            tried += more
    tried = drop_needless(tried, least, thresholds)
    silent = tuple(
        effect for effect in effects if search.largest_response(effect) < thresholds.detected
    )
    return _conclude(nothing, tried, evidence, silent, thresholds, chain)


def _distinct(hopes: Sequence[Proposal]) -> list[Proposal]:
    """Each pair of effects once, however it was come by."""
    found: dict[frozenset[str], Proposal] = {}
    for hope in hopes:
        found.setdefault(frozenset(effect.name for effect in hope.effects), hope)
    return list(found.values())


def _excess(misfit: float, evidence: Evidence) -> float:
    return max(misfit - evidence.expected, 0.0)


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


def _conclude(
    nothing: Fit,
    tried: list[Fit],
    evidence: Evidence,
    silent: tuple[Effect, ...],
    thresholds: Thresholds,
    chain: Sequence[Fit],
) -> Attribution:
    rules = thresholds.rough if evidence.machine.rough else thresholds.known
    cost = partial(penalised_cost, price=thresholds.price)
    gap = max(nothing.misfit - evidence.expected, 0.0)
    pool = sorted([*tried, nothing], key=cost)
    best = pool[0]
    expected = evidence.expected_misfit(best.plant)
    temper = thresholds.temper + thresholds.form_temper * max(best.misfit - expected, 0.0)
    apart = np.array([(cost(fit) - cost(best)) / (2.0 * temper) for fit in pool])
    if evidence.machine.rough:
        # What is left is no noise but the model's error: as many pieces of it as are independent
        # speak for one against another.
        relative = np.array([(cost(fit) + expected) / (cost(best) + expected) for fit in pool])
        apart = 0.5 * _count_independent(evidence, best.plant) * np.log(relative)
    weights = np.exp(-np.minimum(apart, 700.0))
    weights /= weights.sum()
    ranking = tuple(
        Explanation(fit, cost(fit), float(weight))
        for fit, weight in zip(pool, weights, strict=True)
    )
    found = nothing.misfit - cost(best) > detection_limit(evidence, thresholds) and bool(
        best.effects
    )
    if found and len(best.effects) == 1 and within_tolerance(best, evidence, thresholds):
        found = False
    left = max(best.misfit - expected, 0.0) / expected
    explained = min((nothing.misfit - best.misfit) / gap, 1.0) if gap > 0.0 else 0.0
    more = left > thresholds.unexplained
    named = (
        ranking[0]
        if found and not (more and (explained < rules.enough or left > rules.too_much))
        else None
    )
    shares = _shares(named.fit, evidence, explained) if named is not None else {}
    return Attribution(
        nothing=nothing,
        expected=expected,
        best=named,
        ranking=ranking,
        explained=explained if found else 0.0,
        left=left,
        unknown=more,
        shares=shares,
        silent=silent,
        chain=tuple(chain),
    )


def _count_independent(evidence: Evidence, plant: Plant) -> float:
    """How many independent pieces what a plant leaves consists of: the lines that share its power,
    twice, for real and imaginary parts."""
    total = square = 0.0
    for transform in evidence.transforms(evidence.differences(plant)):
        power = np.abs(transform) ** 2
        total, square = total + float(power.sum()), square + float((power**2).sum())
    # The powers of white noise are spread as an exponential, of which this would count half.
    return 4.0 * total**2 / max(square, 1e-300)


def _shares(fit: Fit, evidence: Evidence, explained: float) -> dict[str, float]:
    """The share of the gap of each effect: what would come back without it, of what would for
    all."""
    if len(fit.effects) == 1:
        return {fit.name: explained}
    whole = float(np.sum(evidence.residual(fit.plant) ** 2))
    lost = []
    for _, others, values in without_each(fit):
        residual = evidence.residual(with_values(evidence.plant, others, values))
        lost.append(max(float(np.sum(residual**2)) - whole, 0.0))
    return {
        effect.name: explained * one / max(sum(lost), 1e-9)
        for effect, one in zip(fit.effects, lost, strict=True)
    }
