"""Search for the best settings by scipy's differential evolution.

A generation is scored at a time, so that workers are busy. Every run is stored, and the search's
random numbers depend only on its seed. A search that is started again therefore takes the same path
and skips the runs that exist.
"""

from __future__ import annotations

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.studies.tuning.candidates import Candidate, TuningSearch
from rigtwin.studies.tuning.measures import Measure


def find_best(search: TuningSearch) -> Candidate:
    """Return the best candidate of a study with one objective.

    Raises
    ------
    RigtwinError
        If no candidate is allowed, or the parameters do not change the objective.
    """
    study = search.study
    best = _minimise(search, study.goals.minimise[0], study.budget.evaluations)
    _check_sensitivity(search)
    return best


def find_front(search: TuningSearch) -> tuple[Candidate, ...]:
    """Return the Pareto front of a study with two objectives.

    Each objective is first minimised alone, with a third of the evaluations. The first objective is
    then minimised with bounds on the second between its values at both ends (the ε-constraint
    method).

    Returns
    -------
    tuple of Candidate
        Candidates of the front, the best in the first objective first.

    Raises
    ------
    RigtwinError
        If no candidate is allowed, or the parameters do not change the objectives.
    """
    first, second = search.study.goals.minimise
    budget, between = search.study.budget.evaluations // 3, search.study.budget.points - 2
    ends = [_minimise(search, objective, budget) for objective in (first, second)]
    low, high = (end.score.figures[second.name] for end in ends)
    # The ends are known already.
    for bound in np.linspace(low, high, between + 2)[1:-1].tolist():
        search.minimise(first, max(budget // between, 1), (second, bound))
    _check_sensitivity(search)
    front: list[Candidate] = []
    # In the order of the first objective, a candidate is on the front if it improves the second.
    for candidate in sorted(search.allowed, key=lambda c: (c.cost(first), c.cost(second))):
        if not front or candidate.cost(second) < front[-1].cost(second):
            front.append(candidate)
    return tuple(front)


def _minimise(search: TuningSearch, objective: Measure, evaluations: int) -> Candidate:
    """Return the best allowed candidate. Raise RigtwinError if there is none."""
    best = search.minimise(objective, evaluations)
    if best is not None:
        return best
    goals = search.study.goals
    names = ["trips", "limits", *(constraint.measure.name for constraint in goals.constraints)]
    # The message names what the best candidate fails at, which shows the user what to relax.
    nearest = min(
        search.candidates.values(),
        key=lambda candidate: sum(max(0.0, violation) for violation in candidate.violations),
    )
    pairs = zip(names, nearest.violations, strict=True)
    missed = " and ".join(name for name, violation in pairs if violation > 0.0)
    count = f"none of {len(search.candidates)} candidates meets every constraint"
    raise RigtwinError(f"{count}; the nearest fails at {missed}: allow more, or wider bounds")


def _check_sensitivity(search: TuningSearch) -> None:
    """Raise RigtwinError if the parameters do not change any objective."""
    study, allowed = search.study, search.allowed
    differ = [
        len({candidate.cost(objective) for candidate in allowed}) > 1
        for objective in study.goals.minimise
    ]
    if len(allowed) > 1 and not any(differ):
        names = " and ".join(parameter.key for parameter in study.parameters)
        advice = "is what they belong to switched on?"
        raise RigtwinError(f"{names} make no difference in {study.experiment.name}: {advice}")
