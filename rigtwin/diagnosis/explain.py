"""Explanation of the evidence: the best hypothesis and the weights of all others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.confirmation import confirm
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, leave_one_out
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.search import HypothesisSearch
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.tolerance_refit import PERTURBATIONS, refit_with_tolerances

OBSERVABLE = 60.0
"""Chi-square that an effect must change at some size to count as observable."""


@dataclass(frozen=True)
class Explanation:
    """Result of a search.

    Attributes
    ----------
    posterior
        Weights of all scored hypotheses.
    fit
        Best hypothesis, fitted to all ticks.
    unobservable
        Effects that are not observable on this evidence at any simulated size.
    chain
        Nested fits that lead to the best hypothesis, the fit of a single effect first.
    ended_early
        Whether the effort was spent before all hypotheses were tried.
    leaves_noise
        Whether a confirmation has shown that the best hypothesis leaves noise alone, whatever its
        approximate score says.
    """

    posterior: HypothesisPosterior
    fit: Fit
    unobservable: tuple[Effect, ...]
    chain: tuple[Fit, ...]
    ended_early: bool
    leaves_noise: bool


def candidates(evidence: Evidence) -> list[Effect]:
    """Return the candidate effects of a search.

    Parameters
    ----------
    evidence
        Recordings about their nominal plant.

    Returns
    -------
    list of Effect
        Effects that the machine can have, without those that are read off a single signal.
    """
    return [effect for effect in evidence.machine.effects() if effect.searched]


def explain(
    evidence: Evidence,
    progress: Callable[[int], object] = lambda _: None,
    thresholds: Thresholds = STANDARD,
    first_look: Callable[[FirstLook], object] = lambda _: None,
) -> Explanation:
    """Search the candidate effects for the hypothesis that explains the evidence best.

    Parameters
    ----------
    evidence
        Recordings about their nominal plant.
    progress
        Called with the number of fits completed since the last call.
    thresholds
        Thresholds of search and score.
    first_look
        Called with the first look once all effects are screened, before any is fitted.

    Returns
    -------
    Explanation
        Best hypothesis, and the weights of all others.
    """
    effects = candidates(evidence)
    with Threads(progress) as threads:
        search = HypothesisSearch(evidence, effects, thresholds, threads, first_look)
        posterior = search.run()
        fit, leaves_noise = posterior.best.fit, False
        if fit.effects and search.is_approximate and not search.ended_early:
            confirmed = confirm(evidence, fit, search.coarse, len(effects), thresholds, threads)
            posterior = search.settle_on(confirmed.fit, confirmed.leaves_noise)
            fit = posterior.best.fit
            if set(fit.effects) == set(confirmed.fit.effects):
                fit, leaves_noise = confirmed.fit, confirmed.leaves_noise
        # A search on thinned ticks is followed by one fit to all of them.
        if (
            fit is posterior.best.fit
            and fit.effects
            and search.fine.evidence.models is not evidence.models
        ):
            # Restarts nearby are a search as well, for which no effort may be left.
            restarts = () if search.ended_early else PERTURBATIONS
            fit = refit_with_tolerances(Fitter(evidence), fit, restarts)
        return Explanation(
            posterior=posterior,
            fit=fit,
            unobservable=_unobservable(search, posterior),
            chain=tuple(_nest(search, fit)),
            ended_early=search.ended_early,
            leaves_noise=leaves_noise,
        )


def _unobservable(search: HypothesisSearch, posterior: HypothesisPosterior) -> tuple[Effect, ...]:
    """Return the effects unobservable both at the nominal plant and beside the best hypothesis.

    A refinement of dry friction, for example, has no response at a nominal plant without friction,
    but may have one beside a fitted friction.
    """
    coarse, best = search.coarse, posterior.best.fit
    fitted = {effect for weighted in posterior.ranking for effect in weighted.scored.fit.effects}

    def is_observable(effect: Effect) -> bool:
        if coarse.largest_response(effect) >= OBSERVABLE or effect in fitted:
            return True
        # An effect that excludes a fitted one cannot be simulated beside it, and stays open.
        if clashes(effect, best.effects):
            return True
        if not best.effects or not is_possible((*best.effects, effect), coarse.plant):
            return False
        # Responses are stored in single precision, but their squares are summed in double.
        responses = coarse.responses_beside(effect, best)
        largest = max(coarse.space.misfit(part.astype(np.float64)) for _, part in responses)
        return largest >= OBSERVABLE

    return tuple(effect for effect in search.effects if not is_observable(effect))


def _nest(search: HypothesisSearch, fit: Fit) -> list[Fit]:
    """Return nested fits that end with the best hypothesis, each with one effect more."""
    chain = [fit]
    while len(chain[0].effects) > 1:
        fewer = []
        for _, remaining, values in leave_one_out(chain[0]):
            if not is_possible(remaining, search.fine.plant):
                continue
            # Most subsets were fitted on the way to the best hypothesis, and need no second fit.
            known = search.pool.get(frozenset(remaining))
            if known is not None:
                fewer.append(known.fit)
            elif not search.ended_early:
                fewer.append(search.fine.refine(remaining, values))
        if not fewer:
            break
        chain.insert(0, min(fewer, key=lambda fit: fit.misfit))
    return [fit for fit in chain if fit.effects]
