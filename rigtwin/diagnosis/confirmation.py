"""Confirmation of a hypothesis that an approximate search has found, on the evidence itself.

A search corrects initial states to first order. What that leaves is a residual that only resembles
one of the machine, and an effect may have been added for its sake. So the best hypothesis is fitted
exactly, and with each of its effects left out where it leaves little more than noise.
"""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, is_possible, leave_one_out
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.scoring import Scorer
from rigtwin.diagnosis.starts import Start
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.diagnosis.tolerance_refit import PERTURBATIONS, refit_with_tolerances

NEAR_NOISE = 2.0
"""Ratio of the misfit to that of noise up to which an approximation may have feigned an effect.
What an incomplete model leaves is larger, and so are the effects of which it consists."""
HOPELESS = 10.0
"""Factor on the misfit beyond which the search itself has shown that an effect is needed."""


@dataclass(frozen=True)
class Confirmation:
    """Hypothesis that is left of one that was confirmed.

    Attributes
    ----------
    fit
        Its exact fit.
    leaves_noise
        Whether the residual of that fit is noise and declared error alone.
    """

    fit: Fit
    leaves_noise: bool


def confirm(
    evidence: Evidence,
    fit: Fit,
    coarse: Fitter,
    candidates: int,
    thresholds: Thresholds,
    threads: Threads,
) -> Confirmation:
    """Fit a hypothesis exactly, and leave out the effects that are not worth their price then.

    Parameters
    ----------
    evidence
        Evidence without a search's approximations.
    fit
        Approximate fit of the hypothesis, with at least one effect.
    coarse
        Fitter of the search.
    candidates
        Number of effects that were searched.
    thresholds
        Thresholds of the score.
    threads
        Threads that fit in parallel.

    Returns
    -------
    Confirmation
        The hypothesis, or what is left of it.
    """
    evidence = evidence.near(fit.plant)
    fitter = Fitter(evidence)
    scorer = Scorer(fitter)
    current = refit_with_tolerances(fitter, fit, PERTURBATIONS)
    fits = [current]
    most = HOPELESS * max(fit.misfit, current.misfit)
    while len(current.effects) > 1 and current.misfit <= NEAR_NOISE * evidence.expected:
        rough = threads.map(lambda start: coarse.refine(*start), _leave_out(current, fitter))
        reduced = threads.map(
            lambda fewer: refit_with_tolerances(
                fitter, fitter.refine(fewer.effects, fewer.values), ()
            ),
            [fewer for fewer in rough if fewer.misfit < most],
        )
        if not reduced:
            break
        # The price of a value that may be nominal makes a set costly of which a subset is cheap: so
        # the way goes by misfit, to its end.
        current = min(reduced, key=lambda fewer: fewer.misfit)
        fits += reduced
    pool = [scorer.score(each) for each in (fitter.nominal_fit, *fits)]
    posterior = HypothesisPosterior(pool, fitter, candidates, thresholds)
    better = _fit_again(fitter, posterior)
    if better is not None:
        best = posterior.best.fit
        pool = [each for each in pool if each.fit is not best] + [scorer.score(better)]
        posterior = HypothesisPosterior(pool, fitter, candidates, thresholds)
    return Confirmation(posterior.best.fit, not posterior.has_unexplained_residual)


def _leave_out(fit: Fit, fitter: Fitter) -> list[Start]:
    """Return the other effects of a fit, and their values, for each effect that is left out.

    Sets in which an effect lacks the dry friction that it acts through are omitted.
    """
    reduced = [(effects, values) for _, effects, values in leave_one_out(fit)]
    return [start for start in reduced if is_possible(start[0], fitter.plant)]


def _fit_again(fitter: Fitter, posterior: HypothesisPosterior) -> Fit | None:
    """Return a better fit of the best hypothesis where more than noise remains, else None.

    A free motion has many minima close to each other: what remains may be that of a poor one.
    """
    best = posterior.best.fit
    if not best.effects or not posterior.has_unexplained_residual:
        return None
    refined = fitter.refine(best.effects, best.values)
    again = refit_with_tolerances(fitter, refined, PERTURBATIONS)
    return again if again.misfit < best.misfit else None
