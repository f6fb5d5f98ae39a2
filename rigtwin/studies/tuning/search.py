"""Looks for the best settings with scipy's differential evolution, a generation at a time, so that workers have plenty to do.

Every run is kept, and the search draws its numbers from its seed alone: begun again it goes the same way, without the runs
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
from rigtwin.studies.tuning.bench import Bench, Worth
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import values, with_values
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
class Tried:
    """A candidate. values: one a parameter; violations: of trips, of limits, of each constraint, above 0 where violated."""

    values: tuple[float, ...]
    worth: Worth
    violations: tuple[float, ...]

    @property
    def allowed(self) -> bool:
        return max(self.violations) <= 0.0

    def figure(self, measure: Measure) -> float:
        """The measure as something to be made small."""
        value = self.worth.figures[measure.name]
        return -value if measure.more else value


class Search:
    """A study's candidates in its scenarios; all that were tried are kept in `tried`, in the order in which they were."""

    def __init__(self, bench: Bench, scenarios: Sequence[Scenario], seed: int) -> None:
        self.bench, self.scenarios, self.seed = bench, scenarios, seed
        study = bench.study
        self.start = [getattr(study.reference, parameter.key.partition(".")[2]) for parameter in study.parameters]
        (self.baseline,) = bench.searched([study.reference], scenarios)
        self.bounds = [bound_of(constraint, self.baseline) for constraint in study.constraints]
        self.tried: dict[tuple[float, ...], Tried] = {}

    @property
    def study(self) -> Study:
        return self.bench.study

    def tell(self, shares: Array) -> list[Tried]:
        """Candidates as numbers from 0 to 1, shape (candidates, parameters)."""
        chosen = [values(self.study.parameters, row) for row in shares]
        new = [each for each in dict.fromkeys(chosen) if each not in self.tried]
        settings = [with_values(self.study.configuration.controller, self.study.parameters, each) for each in new]
        for each, worth in zip(new, self.bench.searched(settings, self.scenarios), strict=True):
            self.tried[each] = Tried(each, worth, self._violations(worth))
        return [self.tried[each] for each in chosen]

    def _violations(self, worth: Worth) -> tuple[float, ...]:
        constraints = zip(self.study.constraints, self.bounds, strict=True)
        # What is not a number without a trip is no better than one.
        lost = worth.trips or float(not all(map(math.isfinite, worth.figures.values())))
        scales = [abs(self.baseline.figures[each.measure.name]) for each in self.study.constraints]
        return (
            lost,
            worth.limits - self.study.limits,
            *(excess(each.measure, worth, bound, scale) for (each, bound), scale in zip(constraints, scales, strict=True)),
        )

    def minimised(self, objective: Measure, evaluations: int, within: tuple[Measure, float] | None = None) -> Tried | None:
        """The best candidate allowed, after about so many; None if none is allowed. within: one measure more and its bound.

        What an earlier search tried is where this one begins.
        """
        count = len(self.study.parameters)
        population = max(LEAST, min(max(FEWEST, PER_PARAMETER * count), evaluations))
        random = np.random.default_rng([self.seed, len(self.tried)])

        def beyond(each: Tried) -> list[float]:
            more = [] if within is None else [excess(within[0], each.worth, within[1], abs(within[1]))]
            return [*each.violations, *more]

        def told(shares: Array, of: Callable[[Tried], Sequence[float]]) -> Array:
            """Of shares (parameters, candidates), perhaps of none, or (parameters,) of one."""
            found = np.array([of(each) for each in self.tell(np.atleast_2d(shares.T))])
            return found.T if shares.ndim > 1 else found[0]

        def objectives(shares: Array) -> Array:
            return told(shares, energy)[0] if shares.size else np.empty(0)

        def energy(each: Tried) -> list[float]:
            figure = each.figure(objective)
            return [figure if math.isfinite(figure) else math.inf]

        known = sorted(self.tried.values(), key=lambda each: (max(0.0, *beyond(each)), energy(each)[0]))
        begun = [self._shares(each.values) for each in known[: population // 2]] or [self._shares(self.start)]
        fresh = qmc.LatinHypercube(count, rng=random).random(population - len(begun))
        differential_evolution(
            objectives,
            [(0.0, 1.0)] * count,
            constraints=NonlinearConstraint(lambda shares: told(shares, beyond), -math.inf, 0.0),
            init=np.vstack([begun, fresh]),  # type: ignore[arg-type]
            maxiter=max(0, round(evaluations / population) - 1),
            tol=CONVERGED,
            rng=random,
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        allowed = [each for each in self.tried.values() if max(beyond(each)) <= 0.0]
        return min(allowed, key=lambda each: energy(each)[0], default=None)

    def _shares(self, chosen: Sequence[float]) -> list[float]:
        return [parameter.share(value) for parameter, value in zip(self.study.parameters, chosen, strict=True)]


def bound_of(constraint: Constraint, baseline: Worth) -> float:
    """In the measure's unit. Raises RigtwinError if it is a share of what the baseline did not live to show, or of nothing."""
    if math.isnan(constraint.share):
        return constraint.bound
    name, there = constraint.measure.name, baseline.figures[constraint.measure.name]
    if not math.isfinite(there):
        raise RigtwinError(f"{name} cannot be held to the baseline's: the baseline trips")
    if constraint.share != 1.0 and there <= 0.0:
        raise RigtwinError(f"{name} is {there:.4g} with the baseline, of which there is no share: give a number as its bound")
    return constraint.share * there


def excess(measure: Measure, worth: Worth, bound: float, scale: float) -> float:
    """By how much a measure violates its bound, as a share of the bound or of what is usual; below 0 if it does not."""
    value = worth.figures[measure.name]
    if not math.isfinite(value):
        return TRIPPED
    beyond = bound - value if measure.more else value - bound
    usual = scale if math.isfinite(scale) else 0.0
    return beyond / max(abs(bound), usual, 1e-12)


def best(search: Search) -> Tried:
    """Of a study with one objective. Raises RigtwinError if no candidate is allowed, with what stands in the way."""
    objective = search.study.minimise[0]
    found = search.minimised(objective, search.study.evaluations) or _none(search)
    _sensitive(search)
    return found


def _sensitive(search: Search) -> None:
    """Raises RigtwinError if the parameters make no difference to any objective."""
    allowed = [each for each in search.tried.values() if each.allowed]
    if len(allowed) > 1 and all(len({each.figure(m) for each in allowed}) == 1 for m in search.study.minimise):
        names = " and ".join(parameter.key for parameter in search.study.parameters)
        raise RigtwinError(f"{names} make no difference in {search.study.experiment}: is what they belong to switched on?")


def front(search: Search) -> tuple[Tried, ...]:
    """Of a study with two objectives: candidates that none other beats in both, the best in the first objective first.

    Each objective alone at first, a third of the evaluations each; then the first with the second held to bounds between.
    """
    one, other = search.study.minimise
    budget = search.study.evaluations // 3
    ends = [search.minimised(objective, budget) or _none(search) for objective in (one, other)]
    low, high = (end.worth.figures[other.name] for end in ends)
    between = search.study.points - 2
    for bound in np.linspace(low, high, between + 2)[1:-1].tolist():
        search.minimised(one, max(budget // between, 1), (other, bound))
    _sensitive(search)
    allowed = sorted(
        (each for each in search.tried.values() if each.allowed), key=lambda each: (each.figure(one), each.figure(other))
    )
    kept: list[Tried] = []
    for each in allowed:
        if not kept or each.figure(other) < kept[-1].figure(other):
            kept.append(each)
    return tuple(kept)


def _none(search: Search) -> Tried:
    study = search.study
    names = ["trips", "limits", *(constraint.measure.name for constraint in study.constraints)]
    nearest = min(search.tried.values(), key=lambda each: sum(max(0.0, violation) for violation in each.violations))
    missed = [name for name, violation in zip(names, nearest.violations, strict=True) if violation > 0.0]
    told = f"the nearest fails at {' and '.join(missed)}: allow more, or wider bounds"
    raise RigtwinError(f"none of {len(search.tried)} candidates meets every constraint; {told}")
