"""Which effects explain the evidence, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, leave_one_out
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.search import HypothesisSearch
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

UNSEEN = 60.0
"""Chi-square that an effect must change at some size to count as observable."""


@dataclass(frozen=True)
class Explanation:
    """Everything that a search found.

    Parameters
    ----------
    posterior
        All hypotheses that were tried, with their weights.
    fit
        The best hypothesis, fitted to all ticks.
    unobservable
        Effects that no size tried makes noticeable on this evidence.
    chain
        Nested fits that lead to the best hypothesis, of one effect first.
    """

    posterior: HypothesisPosterior
    fit: Fit
    unobservable: tuple[Effect, ...]
    chain: tuple[Fit, ...]


def candidates(evidence: Evidence) -> list[Effect]:
    """Return the effects that are searched for.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.

    Returns
    -------
    list of Effect
        Effects that the machine can have and that are not read off a signal.
    """
    return [effect for effect in evidence.machine.effects() if effect.searched]


def explain(
    evidence: Evidence,
    progress: Callable[[int], object] = lambda _: None,
    thresholds: Thresholds = STANDARD,
    first_look: Callable[[FirstLook], object] = lambda _: None,
) -> Explanation:
    """HypothesisSearch all candidates for what explains the evidence.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.
    progress
        Called with the number of fits done since its last call.
    thresholds
        Numbers that the search goes by.
    first_look
        Called once every effect was tried, before any is fitted.

    Returns
    -------
    Explanation
        Everything tried, and the best hypothesis.
    """
    effects = candidates(evidence)
    with Threads(progress) as threads:
        search = HypothesisSearch(evidence, effects, thresholds, threads, first_look)
        posterior = search.run()
        best = posterior.best.fit
        fit = best
        if best.effects and search.fine.evidence is not evidence:
            fit = Fitter(evidence).refit_with_tolerances(best)
        return Explanation(
            posterior=posterior,
            fit=fit,
            unobservable=_unobservable(search, posterior),
            chain=tuple(_nest(search, fit)),
        )


def _unobservable(search: HypothesisSearch, posterior: HypothesisPosterior) -> tuple[Effect, ...]:
    """Effects that do nothing at the nominal plant, and nothing beside the best hypothesis either,
    as a refinement of friction does where there is none."""
    coarse, best = search.coarse, posterior.best.fit
    fitted = {effect for each in posterior.ranking for effect in each.scored.fit.effects}

    def shows(effect: Effect) -> bool:
        if coarse.largest_response(effect) >= UNSEEN or effect in fitted:
            return True
        if clashes(effect, best.effects):
            return True
        if not best.effects or not is_possible((*best.effects, effect), coarse.plant):
            return False
        responses = coarse.responses_beside(effect, best)
        most = max(coarse.space.misfit(each.astype(np.float64)) for _, each in responses)
        return most >= UNSEEN

    return tuple(effect for effect in search.effects if not shows(effect))


def _nest(search: HypothesisSearch, fit: Fit) -> list[Fit]:
    """The best hypothesis, and before it the best with one effect fewer each time."""
    chain = [fit]
    while len(chain[0].effects) > 1:
        fewer = []
        for _, rest, values in leave_one_out(chain[0]):
            if not is_possible(rest, search.fine.plant):
                continue
            known = search.pool.get(frozenset(rest))
            fewer.append(known.fit if known is not None else search.fine.refine(rest, values))
        if not fewer:
            break
        chain.insert(0, min(fewer, key=lambda each: each.misfit))
    return [each for each in chain if each.effects]
