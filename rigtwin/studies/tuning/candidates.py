"""Candidates of a tuning search, and how they are evaluated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import NonlinearConstraint, differential_evolution
from scipy.stats import qmc

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.studies.tuning.bench import Bench, Score
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import set_values, values_at
from rigtwin.studies.tuning.scenario import Scenario
from rigtwin.studies.tuning.study import Constraint, Study

PER_PARAMETER, MIN_GENERATION = 5, 8
"""Candidates per generation: number for each parameter, and minimum."""
SCIPY_MINIMUM = 5
"""Smallest generation that scipy's search accepts."""
CONVERGED = 2e-3
"""Relative spread of a generation's objective at which the search ends."""
TRIPPED = 10.0
"""Relative violation assigned to a measure that is missing because of a trip."""


@dataclass(frozen=True)
class Candidate:
    """Settings tried by the search.

    Parameters
    ----------
    values : tuple of float
        Value of each parameter.
    score : Score
        Score over the search's scenarios.
    violations : tuple of float
        Relative violations of trips, limits, and each constraint; above 0 where violated.
    """

    values: tuple[float, ...]
    score: Score
    violations: tuple[float, ...]

    @property
    def allowed(self) -> bool:
        """Whether the candidate violates no constraint."""
        return max(self.violations) <= 0.0

    def cost(self, measure: Measure) -> float:
        """Return the measure with the sign that makes smaller better."""
        value = self.score.figures[measure.name]
        return -value if measure.more else value


class TuningSearch:
    """Search of one study: its scenarios, and all candidates tried.

    Parameters
    ----------
    bench : Bench
        Runs of the study.
    scenarios : sequence of Scenario
        Scenarios in which every candidate is simulated.
    seed : int
        Seed of the search's random numbers.

    Attributes
    ----------
    baseline : Score
        Score of the baseline settings.
    candidates : dict
        Values → candidate, in the order in which they were tried.
    """

    def __init__(self, bench: Bench, scenarios: Sequence[Scenario], seed: int) -> None:
        self.bench, self.scenarios, self.seed = bench, scenarios, seed
        study, settings = bench.study, bench.study.baseline_settings
        self.start = [getattr(settings, parameter.name) for parameter in study.parameters]
        (self.baseline,) = bench.score([settings], scenarios)
        self.bounds = [
            bound_of(constraint, self.baseline) for constraint in study.goals.constraints
        ]
        self.candidates: dict[tuple[float, ...], Candidate] = {}

    @property
    def study(self) -> Study:
        """Study that is tuned."""
        return self.bench.study

    @property
    def allowed(self) -> list[Candidate]:
        """Candidates that violate no constraint."""
        return [candidate for candidate in self.candidates.values() if candidate.allowed]

    def score(self, shares: Array) -> list[Candidate]:
        """Return the candidates at shares between bounds, shape (candidates, parameters)."""
        study = self.study
        asked = [values_at(study.parameters, row) for row in shares]
        # Values are rounded, so different shares can be the same candidate: each runs once.
        new = [values for values in dict.fromkeys(asked) if values not in self.candidates]
        base = study.configuration.controller
        settings = [set_values(base, study.parameters, values) for values in new]
        for values, score in zip(new, self.bench.score(settings, self.scenarios), strict=True):
            self.candidates[values] = Candidate(values, score, self._violations(score))
        return [self.candidates[values] for values in asked]

    def _violations(self, score: Score) -> tuple[float, ...]:
        goals = self.study.goals
        # A figure that is NaN without a trip counts as a trip.
        lost = score.trips or float(not all(map(math.isfinite, score.figures.values())))
        beyond = []
        for constraint, bound in zip(goals.constraints, self.bounds, strict=True):
            # The baseline's figure sets the scale of a violation, also where the bound is 0.
            usual = abs(self.baseline.figures[constraint.measure.name])
            beyond.append(excess(constraint.measure, score, bound, usual))
        return lost, score.limits - goals.limits, *beyond

    def minimise(
        self, objective: Measure, evaluations: int, within: tuple[Measure, float] | None = None
    ) -> Candidate | None:
        """Search for the best allowed candidate, starting from those already tried.

        Parameters
        ----------
        objective : Measure
            Measure to be minimised, or maximised if more of it is better.
        evaluations : int
            Approximate number of candidates to try.
        within : (Measure, float), optional
            Additional measure and its bound.

        Returns
        -------
        Candidate or None
            Best candidate, or None if none is allowed.
        """
        problem = _Problem(self, objective, within)
        count = len(self.study.parameters)
        generation = max(MIN_GENERATION, PER_PARAMETER * count)
        population = max(SCIPY_MINIMUM, min(generation, evaluations))
        # The number of candidates enters the seed, so that a second search of a front does not
        # repeat the random numbers of the first.
        random = np.random.default_rng([self.seed, len(self.candidates)])
        # Half of the first generation are the best candidates so far; the rest fills the space.
        best = sorted(self.candidates.values(), key=problem.order)[: population // 2]
        start = [self._shares(candidate.values) for candidate in best]
        start = start or [self._shares(self.start)]
        fresh = qmc.LatinHypercube(count, rng=random).random(population - len(start))
        differential_evolution(
            problem.costs,
            [(0.0, 1.0)] * count,
            constraints=NonlinearConstraint(problem.excesses, -math.inf, 0.0),
            init=np.vstack([start, fresh]),  # type: ignore[arg-type]
            maxiter=max(0, round(evaluations / population) - 1),
            tol=CONVERGED,
            rng=random,
            polish=False,
            # Deferred updating scores a whole generation at a time, which workers share.
            updating="deferred",
            vectorized=True,
        )
        tried = self.candidates.values()
        allowed = [candidate for candidate in tried if max(problem.violations(candidate)) <= 0.0]
        return min(allowed, key=problem.cost, default=None)

    def _shares(self, values: Sequence[float]) -> list[float]:
        pairs = zip(self.study.parameters, values, strict=True)
        return [parameter.share(value) for parameter, value in pairs]


class _Problem:
    """Optimisation problem in the form that scipy's differential evolution takes.

    Parameters
    ----------
    search
        Search whose candidates are scored.
    objective
        Measure to be optimised.
    within
        Additional measure and its bound.
    """

    def __init__(
        self, search: TuningSearch, objective: Measure, within: tuple[Measure, float] | None
    ) -> None:
        self._search, self._objective, self._within = search, objective, within

    def violations(self, candidate: Candidate) -> list[float]:
        """Return the relative violations of a candidate."""
        if self._within is None:
            return [*candidate.violations]
        measure, bound = self._within
        return [*candidate.violations, excess(measure, candidate.score, bound, abs(bound))]

    def cost(self, candidate: Candidate) -> float:
        """Return the objective of a candidate, infinite if it is missing."""
        figure = candidate.cost(self._objective)
        return figure if math.isfinite(figure) else math.inf

    def order(self, candidate: Candidate) -> tuple[float, float]:
        """Return a sort key: the worst violation first, then the cost."""
        return max(0.0, *self.violations(candidate)), self.cost(candidate)

    def costs(self, shares: Array) -> Array:
        """Return the costs at shares of shape (parameters, candidates), or (parameters,)."""
        # scipy asks for the costs of an empty set if all candidates violate constraints.
        return self._rate(shares, lambda c: [self.cost(c)])[0] if shares.size else np.empty(0)

    def excesses(self, shares: Array) -> Array:
        """Return the violations at shares of shape (parameters, candidates), or (parameters,)."""
        return self._rate(shares, self.violations)

    def _rate(self, shares: Array, rate: Callable[[Candidate], Sequence[float]]) -> Array:
        # scipy passes a whole generation as columns, but sometimes a single vector, or none.
        candidates = self._search.score(np.atleast_2d(shares.T))
        rated = np.array([rate(candidate) for candidate in candidates])
        return rated.T if shares.ndim > 1 else rated[0]


def bound_of(constraint: Constraint, baseline: Score) -> float:
    """Return a constraint's bound in the measure's unit.

    Raises
    ------
    RigtwinError
        If the bound is a share of a figure that the baseline lacks or that is not positive.
    """
    if math.isnan(constraint.share):
        return constraint.bound
    name = constraint.measure.name
    figure = baseline.figures[name]
    if not math.isfinite(figure):
        raise RigtwinError(f"{name} cannot be held to the baseline's: the baseline trips")
    if constraint.share != 1.0 and figure <= 0.0:
        advice = "of which there is no share: give a number as its bound"
        raise RigtwinError(f"{name} is {figure:.4g} with the baseline, {advice}")
    return constraint.share * figure


def excess(measure: Measure, score: Score, bound: float, usual: float) -> float:
    """Return the relative violation of a bound; negative if the bound is respected.

    Parameters
    ----------
    measure : Measure
        Measure with the bound.
    score : Score
        Score of the candidate.
    bound : float
        Bound in the measure's unit.
    usual : float
        Typical size in the measure's unit. The violation is relative to this or to the bound,
        whichever is larger.
    """
    value = score.figures[measure.name]
    if not math.isfinite(value):
        return TRIPPED
    beyond = bound - value if measure.more else value - bound
    return beyond / max(abs(bound), usual if math.isfinite(usual) else 0.0, 1e-12)
