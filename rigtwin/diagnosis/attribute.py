"""Which effects explain the evidence: every candidate fitted, pairs where one is not enough, and
how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.beginnings import fit_beginnings
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, with_values, without_each
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.held_out_judge import HeldOutJudge, Judged
from rigtwin.diagnosis.pairs import fit_pairs
from rigtwin.diagnosis.ranking import best_of_each, drop_needless, penalised_cost, within_tolerance
from rigtwin.diagnosis.search import Search, detection_limit
from rigtwin.diagnosis.selection import Selection, select
from rigtwin.diagnosis.stepwise import Growth, fit_stepwise
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

NEAREST = 12
"""Explanations that may remove nearly all of a gap, the likeliest."""


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
    evidence; chain: nested fits, the best of one effect first; selection: of a rough model, what
    was judged on held-out data."""

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
    selection: Selection | None = None


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
    first_look: Callable[[FirstLook], object] = lambda _: None,
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
    first_look
        Called once every effect has been tried and before any is fitted.

    Returns
    -------
    Attribution
        Everything tried, and the explanation to be named.
    """
    effects = library(evidence)
    searched = evidence.thin() if evidence.machine.rough else evidence
    coarse = Fitter(searched.halve_steps())
    with Threads(progress) as threads:
        least = detection_limit(evidence, thresholds)
        fitter = Fitter(searched)
        search = Search(coarse, fitter, effects, least, thresholds, threads, told=first_look)
        nothing, tried = search.fit_singles()
        silent = tuple(
            effect for effect in effects if coarse.largest_response(effect) < thresholds.detected
        )
        if evidence.machine.rough:
            final = search.fitter if searched is evidence else Fitter(evidence)
            return _attribute_rough(search, final, nothing, tried, silent)
        if nothing.misfit - search.cost(tried[0]) > least:
            tried += fit_pairs(search, nothing, tried)
            tried += fit_beginnings(search, tried)
    chain = [fit for fit in drop_needless(tried, least, thresholds) if fit.effects][:1]
    tried = drop_needless(tried, least, thresholds)
    return _conclude(nothing, tried, evidence, silent, thresholds, chain)


def _attribute_rough(
    search: Search,
    final: Fitter,
    nothing: Fit,
    singles: Sequence[Fit],
    silent: tuple[Effect, ...],
) -> Attribution:
    """The same of a machine whose nominal values are only a start: what is named is what data held
    out of the fit ask for. final: on all ticks."""
    evidence, thresholds = search.fitter.evidence, search.thresholds
    judge = HeldOutJudge(search.fitter, thresholds.selection)
    growth = Growth(search.coarse, judge, search.effects, search.least, thresholds)
    tried = [*singles]
    if nothing.misfit - search.cost(singles[0]) > search.least:
        tried += fit_stepwise(singles, growth, search.threads)
    tried = [
        fit
        for fit in drop_needless(tried, search.least, thresholds)
        if not within_tolerance(fit, evidence, thresholds)
    ]
    selection = select(
        [nothing, *tried],
        search.coarse,
        judge,
        search.effects,
        search.threads,
    )
    selection = _settle(selection, final)
    chain = _nest(search.fitter, selection)
    silent = _still_silent(search, silent, selection)
    return _conclude_rough(final, search.least, thresholds, selection, chain, silent)


def _still_silent(
    search: Search, silent: Sequence[Effect], selection: Selection
) -> tuple[Effect, ...]:
    """Of effects that do nothing at the nominal plant those that do nothing beside what was found
    either, as a refinement of friction does where there is none."""
    chosen = selection.chosen.fit
    tried = {effect for each in selection.pool for effect in each.fit.effects}

    def shows(effect: Effect) -> bool:
        if effect in tried or clashes(effect, chosen.effects):
            return True
        if not is_possible((*chosen.effects, effect), search.coarse.plant):
            return False
        found = search.coarse.responses_beside(effect, chosen)
        space = search.coarse.space
        most = max(space.misfit(response.astype(np.float64)) for _, response in found)
        return most >= search.thresholds.detected

    return tuple(effect for effect in silent if not shows(effect))


def _settle(selection: Selection, final: Fitter) -> Selection:
    """The chosen explanation fitted to all ticks; if a value runs to a bound there, another is
    chosen."""
    while selection.chosen.fit.effects:
        settled = final.refit_with_tolerances(selection.chosen.fit)
        if not final.is_bounded(settled):
            return selection.replace_chosen(settled)
        selection = selection.without(selection.chosen)
    return selection


def _conclude(
    nothing: Fit,
    tried: list[Fit],
    evidence: Evidence,
    silent: tuple[Effect, ...],
    thresholds: Thresholds,
    chain: Sequence[Fit],
) -> Attribution:
    rules = thresholds.known
    cost = partial(penalised_cost, price=thresholds.price)
    gap = max(nothing.misfit - evidence.expected, 0.0)

    def explained_by(fit: Fit) -> float:
        return min((nothing.misfit - fit.misfit) / gap, 1.0) if gap > 0.0 else 0.0

    def left_by(fit: Fit) -> float:
        expected = evidence.expected_misfit(fit.plant)
        return max(fit.misfit - expected, 0.0) / expected

    pool = best_of_each([*tried, nothing], cost)
    forbidden = left_by(pool[0]) > rules.too_much
    if forbidden:
        # What removes nearly all is named though the model is not exact, but nothing beside it.
        before = relative_errors(evidence, nothing.plant)
        removing = [
            fit
            for fit in pool[:NEAREST]
            if np.all(relative_errors(evidence, fit.plant) <= (1.0 - rules.nearly_all) * before)
        ]
        if removing:
            forbidden = False
            most = min(len(fit.effects) for fit in removing)
            pool = [fit for fit in pool if len(fit.effects) <= most]
    best = pool[0]
    expected, left, explained = (
        evidence.expected_misfit(best.plant),
        left_by(best),
        explained_by(best),
    )
    temper = thresholds.temper + thresholds.form_temper * max(best.misfit - expected, 0.0)
    apart = np.array([(cost(fit) - cost(best)) / (2.0 * temper) for fit in pool])
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
    more = left > thresholds.unexplained
    named = ranking[0] if found and not (more and (explained < rules.enough or forbidden)) else None
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


def _conclude_rough(
    final: Fitter,
    least: float,
    thresholds: Thresholds,
    selection: Selection,
    chain: Sequence[Fit],
    silent: tuple[Effect, ...],
) -> Attribution:
    evidence, nothing = final.evidence, final.refit_with_tolerances(final.nothing)
    rules, chosen = thresholds.selection, selection.chosen
    best = chosen.fit
    expected = evidence.expected_misfit(best.plant)
    gap = max(nothing.misfit - evidence.expected, 0.0)
    empty = next(each for each in selection.pool if not each.fit.effects)
    more = max(best.misfit - expected, 0.0) / expected > thresholds.unexplained
    found = (
        bool(best.effects)
        and nothing.misfit - best.misfit > least
        and (
            not more
            or empty.score - chosen.score > rules.least
            or _is_in_every_recording(selection, empty)
        )
    )
    # What adds to the chosen one is no rival of it.
    rivals = [
        each
        for each in selection.pool
        if each is not chosen and not set(best.effects) < set(each.fit.effects)
    ]
    behind = np.array([max(each.score - chosen.score, 0.0) for each in (chosen, *rivals)])
    weights = np.exp(-behind / (rules.alike / 3.0))
    weights /= weights.sum()
    ranking = tuple(
        Explanation(each.fit, each.score, float(weight))
        for each, weight in zip((chosen, *rivals), weights, strict=True)
    )
    explained = min((nothing.misfit - best.misfit) / gap, 1.0) if gap > 0.0 else 0.0
    return Attribution(
        nothing=nothing,
        expected=expected,
        best=ranking[0] if found else None,
        ranking=ranking,
        explained=explained if found else 0.0,
        left=max(best.misfit - expected, 0.0) / expected,
        unknown=more,
        shares=_shares(best, evidence, explained) if found else {},
        silent=silent,
        chain=tuple(chain),
        selection=selection,
    )


def _is_in_every_recording(selection: Selection, empty: Judged) -> bool:
    """Whether each of several recordings asks for the same: then it is there, though much more is
    left."""
    chosen, rules = selection.chosen, selection.rules
    nominal = [e.nominal(selection.nominal)[e.kind.parameters[0]] for e in chosen.fit.effects]
    return (
        len(chosen.errors) >= rules.several
        and bool(np.all(chosen.errors < empty.errors))
        and chosen.is_stable(nominal, rules.certain)
    )


def prefer_held_out(
    found: Attribution,
    evidence: Evidence,
    held_out: Evidence,
    thresholds: Thresholds = STANDARD,
) -> Attribution:
    """Of explanations of a rough model the one that does best on all recordings, those among them
    that none was fitted to.

    Parameters
    ----------
    found
        What was chosen.
    evidence
        By which.
    held_out
        Other recordings.
    thresholds
        What figures are held against.

    Returns
    -------
    Attribution
        With that one in the place of the chosen one.
    """
    if found.selection is None or found.best is None:
        return found
    selection = found.selection.beside(lambda fit: relative_errors(held_out, fit.plant))
    if selection.chosen.fit is found.selection.chosen.fit:
        return found
    final = Fitter(evidence)
    selection = _settle(selection, final)
    chain = _nest(final, selection)
    least = detection_limit(evidence, thresholds)
    return _conclude_rough(final, least, thresholds, selection, chain, found.silent)


def _nest(fitter: Fitter, selection: Selection) -> list[Fit]:
    """The chosen fit, and before it the best of one effect fewer each time."""
    chain = [selection.chosen.fit]
    known = {frozenset(each.fit.effects): each.fit for each in selection.pool}
    while len(chain[0].effects) > 1:
        fewer = [
            known.get(frozenset(rest)) or fitter.refine(rest, values)
            for _, rest, values in without_each(chain[0])
            if is_possible(rest, fitter.plant)
        ]
        chain.insert(0, min(fewer, key=lambda fit: fit.misfit))
    return [fit for fit in chain if fit.effects]


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
