"""Looks for the best settings with scipy's differential evolution.

A generation is scored at a time, so that workers have plenty to do. Every run is kept, and the
search draws its numbers from its seed alone: begun again it goes the same way, without the runs
that were made.
"""

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

PER_PARAMETER, FEWEST = 5, 8
"""Candidates of a generation for each parameter, and at least."""
LEAST = 5
"""Candidates of a generation that scipy's search needs."""
CONVERGED = 2e-3
"""Spread of a generation's objective, as a share of it, at which the search ends."""
TRIPPED = 10.0
"""How badly a measure that no run lived to show violates its constraint."""


@dataclass(frozen=True)
class Candidate:
    """Settings that were tried.

    Parameters
    ----------
    values : tuple of float
        One a parameter.
    score : Score
        What they came to over the search's scenarios.
    violations : tuple of float
        Of trips, of limits, of each constraint; above 0 where violated.
    """

    values: tuple[float, ...]
    score: Score
    violations: tuple[float, ...]

    @property
    def allowed(self) -> bool:
        """Whether it violates nothing."""
        return max(self.violations) <= 0.0

    def cost(self, measure: Measure) -> float:
        """The measure as something to be made small."""
        value = self.score.figures[measure.name]
        return -value if measure.more else value


class Search:
    """A study's candidates in its scenarios.

    Parameters
    ----------
    bench : Bench
        Where they are scored.
    scenarios : sequence of Scenario
        That every candidate meets.
    seed : int
        Of the search's random numbers.

    Attributes
    ----------
    baseline : Score
        Of the settings that are compared with.
    candidates : dict
        Values → candidate, all that were tried, in the order in which they were.
    """

    def __init__(self, bench: Bench, scenarios: Sequence[Scenario], seed: int) -> None:
        self.bench, self.scenarios, self.seed = bench, scenarios, seed
        study, settings = bench.study, bench.study.baseline_settings
        self.start = [getattr(settings, parameter.name) for parameter in study.parameters]
        (self.baseline,) = bench.score([settings], scenarios)
        self.bounds = [bound_of(each, self.baseline) for each in study.goals.constraints]
        self.candidates: dict[tuple[float, ...], Candidate] = {}

    @property
    def study(self) -> Study:
        """What is looked for."""
        return self.bench.study

    @property
    def allowed(self) -> list[Candidate]:
        """The candidates that violate nothing."""
        return [each for each in self.candidates.values() if each.allowed]

    def score(self, shares: Array) -> list[Candidate]:
        """Score candidates given as shares between bounds, shape (candidates, parameters)."""
        study = self.study
        asked = [values_at(study.parameters, row) for row in shares]
        new = [each for each in dict.fromkeys(asked) if each not in self.candidates]
        base = study.configuration.controller
        settings = [set_values(base, study.parameters, each) for each in new]
        for each, score in zip(new, self.bench.score(settings, self.scenarios), strict=True):
            self.candidates[each] = Candidate(each, score, self._violations(score))
        return [self.candidates[each] for each in asked]

    def _violations(self, score: Score) -> tuple[float, ...]:
        goals = self.study.goals
        # What is not a number without a trip is no better than one.
        lost = score.trips or float(not all(map(math.isfinite, score.figures.values())))
        beyond = []
        for constraint, bound in zip(goals.constraints, self.bounds, strict=True):
            usual = abs(self.baseline.figures[constraint.measure.name])
            beyond.append(excess(constraint.measure, score, bound, usual))
        return lost, score.limits - goals.limits, *beyond

    def minimise(
        self,
        objective: Measure,
        evaluations: int,
        within: tuple[Measure, float] | None = None,
    ) -> Candidate | None:
        """Look for the best candidate allowed, from what an earlier search tried.

        Parameters
        ----------
        objective : Measure
            What is to be made small, or large where more is better.
        evaluations : int
            Candidates to try, about.
        within : (Measure, float), optional
            One measure more that is held to a bound.

        Returns
        -------
        Candidate or None
            None if none is allowed.
        """
        count = len(self.study.parameters)
        population = max(LEAST, min(max(FEWEST, PER_PARAMETER * count), evaluations))
        random = np.random.default_rng([self.seed, len(self.candidates)])

        def violations(each: Candidate) -> list[float]:
            if within is None:
                return [*each.violations]
            measure, bound = within
            return [*each.violations, excess(measure, each.score, bound, abs(bound))]

        def cost(each: Candidate) -> float:
            figure = each.cost(objective)
            return figure if math.isfinite(figure) else math.inf

        def rate(shares: Array, of: Callable[[Candidate], Sequence[float]]) -> Array:
            """Of shares (parameters, candidates), perhaps of none, or (parameters,) of one."""
            rated = np.array([of(each) for each in self.score(np.atleast_2d(shares.T))])
            return rated.T if shares.ndim > 1 else rated[0]

        def costs(shares: Array) -> Array:
            return rate(shares, lambda each: [cost(each)])[0] if shares.size else np.empty(0)

        def order(each: Candidate) -> tuple[float, float]:
            return max(0.0, *violations(each)), cost(each)

        known = sorted(self.candidates.values(), key=order)[: population // 2]
        start = [self._shares(each.values) for each in known] or [self._shares(self.start)]
        fresh = qmc.LatinHypercube(count, rng=random).random(population - len(start))
        limit = NonlinearConstraint(lambda shares: rate(shares, violations), -math.inf, 0.0)
        differential_evolution(
            costs,
            [(0.0, 1.0)] * count,
            constraints=limit,
            init=np.vstack([start, fresh]),  # type: ignore[arg-type]
            maxiter=max(0, round(evaluations / population) - 1),
            tol=CONVERGED,
            rng=random,
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        allowed = [each for each in self.candidates.values() if max(violations(each)) <= 0.0]
        return min(allowed, key=cost, default=None)

    def _shares(self, values: Sequence[float]) -> list[float]:
        pairs = zip(self.study.parameters, values, strict=True)
        return [parameter.share(value) for parameter, value in pairs]


def bound_of(constraint: Constraint, baseline: Score) -> float:
    """A constraint's bound in the measure's unit.

    Raises
    ------
    RigtwinError
        If it is a share of what the baseline did not live to show, or of nothing.
    """
    if math.isnan(constraint.share):
        return constraint.bound
    name = constraint.measure.name
    there = baseline.figures[name]
    if not math.isfinite(there):
        raise RigtwinError(f"{name} cannot be held to the baseline's: the baseline trips")
    if constraint.share != 1.0 and there <= 0.0:
        advice = "of which there is no share: give a number as its bound"
        raise RigtwinError(f"{name} is {there:.4g} with the baseline, {advice}")
    return constraint.share * there


def excess(measure: Measure, score: Score, bound: float, usual: float) -> float:
    """By how much a measure violates its bound, relative; below 0 if it does not.

    Parameters
    ----------
    measure : Measure
        What is bounded.
    score : Score
        What it came to.
    bound : float
        In the measure's unit.
    usual : float
        Its size in the measure's unit: it is the share of this, or of the bound if that is larger.
    """
    value = score.figures[measure.name]
    if not math.isfinite(value):
        return TRIPPED
    beyond = bound - value if measure.more else value - bound
    return beyond / max(abs(bound), usual if math.isfinite(usual) else 0.0, 1e-12)


def find_best(search: Search) -> Candidate:
    """Find the best candidate of a study with one objective.

    Raises
    ------
    RigtwinError
        If no candidate is allowed, with what stands in the way; if the parameters do nothing.
    """
    study = search.study
    best = _minimise(search, study.goals.minimise[0], study.budget.evaluations)
    _check_sensitivity(search)
    return best


def find_front(search: Search) -> tuple[Candidate, ...]:
    """Find the candidates of a study with two objectives that none other beats in both.

    Each objective alone at first, a third of the evaluations each; then the first with the second
    held to bounds between.

    Returns
    -------
    tuple of Candidate
        The best in the first objective first.

    Raises
    ------
    RigtwinError
        As `find_best`.
    """
    one, other = search.study.goals.minimise
    budget, between = search.study.budget.evaluations // 3, search.study.budget.points - 2
    ends = [_minimise(search, objective, budget) for objective in (one, other)]
    low, high = (end.score.figures[other.name] for end in ends)
    for bound in np.linspace(low, high, between + 2)[1:-1].tolist():
        search.minimise(one, max(budget // between, 1), (other, bound))
    _check_sensitivity(search)
    front: list[Candidate] = []
    for each in sorted(search.allowed, key=lambda each: (each.cost(one), each.cost(other))):
        if not front or each.cost(other) < front[-1].cost(other):
            front.append(each)
    return tuple(front)


def _minimise(search: Search, objective: Measure, evaluations: int) -> Candidate:
    """The best candidate allowed. Raises RigtwinError if there is none."""
    best = search.minimise(objective, evaluations)
    if best is not None:
        return best
    goals = search.study.goals
    names = ["trips", "limits", *(each.measure.name for each in goals.constraints)]
    nearest = min(
        search.candidates.values(),
        key=lambda each: sum(max(0.0, violation) for violation in each.violations),
    )
    pairs = zip(names, nearest.violations, strict=True)
    missed = " and ".join(name for name, violation in pairs if violation > 0.0)
    count = f"none of {len(search.candidates)} candidates meets every constraint"
    raise RigtwinError(f"{count}; the nearest fails at {missed}: allow more, or wider bounds")


def _check_sensitivity(search: Search) -> None:
    """Raises RigtwinError if the parameters make no difference to any objective."""
    study, allowed = search.study, search.allowed
    differ = [len({each.cost(one) for each in allowed}) > 1 for one in study.goals.minimise]
    if len(allowed) > 1 and not any(differ):
        names = " and ".join(parameter.key for parameter in study.parameters)
        advice = "is what they belong to switched on?"
        raise RigtwinError(f"{names} make no difference in {study.experiment.name}: {advice}")
