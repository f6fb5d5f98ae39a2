"""A whole study: tuned on the rig as it is known, evaluated on what the search has not seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.description.posterior import Posterior
from rigtwin.studies.tuning.bench import Bench, Score
from rigtwin.studies.tuning.evaluation import Comparison, evaluate
from rigtwin.studies.tuning.parameter import Settings, set_values
from rigtwin.studies.tuning.scenario import APART, NOMINAL, Rig, calibrated_rig, draw_scenarios
from rigtwin.studies.tuning.search import Candidate, Search, find_best, find_front
from rigtwin.studies.tuning.study import Study

TUNED, BEFORE, TUNED_NOMINAL = "tuned", "before", "tuned on the nominal twin"


@dataclass(frozen=True)
class TuningResult:
    """What came out of a study.

    Parameters
    ----------
    study : Study
        What was asked.
    seed : int
        Of the search.
    rig : str
        Name of what was tuned on.
    baseline : Score
        Of the settings that are compared with, over the search's scenarios.
    candidates : tuple of Candidate
        All that were tried, in the order in which they were.
    front : tuple of Candidate
        With two objectives those that none beats, thinned to the study's number of points; else
        the best alone.
    chosen : Candidate
        The one to be used; of a front the one nearest to the best in both.
    comparisons : tuple of Comparison
        Of the chosen one on held-out scenarios.
    front_comparisons : tuple of Comparison
        Of each point of a front with the baseline, likewise.
    alike : bool
        Whether nothing but noise differs between scenarios.
    """

    study: Study
    seed: int
    rig: str
    baseline: Score
    candidates: tuple[Candidate, ...]
    front: tuple[Candidate, ...]
    chosen: Candidate
    comparisons: tuple[Comparison, ...]
    front_comparisons: tuple[Comparison, ...]
    alike: bool = False

    @property
    def settings(self) -> Settings:
        """The controller as tuned."""
        return settings_of(self.study, self.chosen)

    @property
    def main(self) -> Comparison:
        """The tuned settings against the baseline, on the rig that they were tuned on."""
        return self.comparisons[0]


def settings_of(study: Study, candidate: Candidate) -> Settings:
    """The controller with a candidate's values."""
    return set_values(study.configuration.controller, study.parameters, candidate.values)


def tune(
    bench: Bench,
    seed: int,
    posterior: Posterior | None = None,
    stage: Callable[[str], object] = lambda _: None,
) -> TuningResult:
    """Tune, and evaluate what was found.

    Parameters
    ----------
    bench : Bench
        Where the study's runs are made.
    seed : int
        Of the search.
    posterior : Posterior, optional
        Of a diagnosis of the rig. The tuning is then done on the nominal twin too, so that what
        the diagnosis is worth, and what it would cost if it were wrong, is known.
    stage : callable, optional
        Called with what begins.

    Raises
    ------
    RigtwinError
        If no candidate meets the constraints.
    """
    study = bench.study
    rig = NOMINAL if posterior is None else calibrated_rig(posterior)
    stage(f"tuning on the {rig.name}")
    search, front = _search(bench, rig, seed)
    chosen, points = _choose(search, front), _thin(front, study.budget.points)
    rivals = [(BEFORE, study.baseline_settings)]
    if posterior is not None:
        stage(f"tuning on the {NOMINAL.name}")
        rivals.append((TUNED_NOMINAL, find_settings(bench, NOMINAL, seed)))
    comparisons = []
    after = (TUNED, settings_of(study, chosen))
    for other in _rigs(study, rig, posterior):
        stage(f"evaluating on the {other.name}")
        scenarios = draw_scenarios(study, other, study.budget.held_out, APART)
        comparisons += [evaluate(bench, other.name, scenarios, rival, after) for rival in rivals]
    front_comparisons = []
    if len(study.goals.minimise) == 2:
        stage("evaluating the front")
        scenarios = draw_scenarios(study, rig, study.budget.held_out, APART)
        for number, point in enumerate(points, start=1):
            after = (f"point {number}", settings_of(study, point))
            front_comparisons.append(evaluate(bench, rig.name, scenarios, rivals[0], after))
    return TuningResult(
        study=study,
        seed=seed,
        rig=rig.name,
        baseline=search.baseline,
        candidates=tuple(search.candidates.values()),
        front=points,
        chosen=chosen,
        comparisons=tuple(comparisons),
        front_comparisons=tuple(front_comparisons),
        alike=_are_alike(study, rig),
    )


def count_runs(study: Study, posterior: Posterior | None) -> int:
    """About how many runs a tuning makes.

    Parameters
    ----------
    study : Study
        What is tuned.
    posterior : Posterior or None
        Of a diagnosis of the rig, if it is tuned on a calibrated twin.
    """
    budget = study.budget
    searches = 1 if posterior is None else 2
    rigs = 1 + len(study.other_rigs) + (0 if posterior is None else 1 + len(posterior.otherwise))
    points = budget.points if len(study.goals.minimise) == 2 else 0
    tried = searches * (budget.evaluations + 1) * budget.roads
    return tried + budget.held_out * (rigs * (1 + searches) + points)


def find_settings(bench: Bench, rig: Rig, seed: int) -> Settings:
    """Tune on a rig without evaluating. Raises RigtwinError if no candidate is allowed."""
    return settings_of(bench.study, _choose(*_search(bench, rig, seed)))


def _search(bench: Bench, rig: Rig, seed: int) -> tuple[Search, tuple[Candidate, ...]]:
    scenarios = draw_scenarios(bench.study, rig, bench.study.budget.roads, 0)
    search = Search(bench, scenarios, seed)
    if len(bench.study.goals.minimise) == 1:
        return search, (find_best(search),)
    return search, find_front(search)


def _are_alike(study: Study, rig: Rig) -> bool:
    """Whether no road, no tolerance and nothing that varies tells one scenario from another."""
    configuration, demands = study.search_configuration, study.experiment.demands
    one, other = draw_scenarios(study, rig, 2, APART)
    first, second = (demands(configuration, seed) for seed in (0, APART))
    pairs = [(first, second)]
    if isinstance(first, Mapping):
        pairs = [(signal, second[name]) for name, signal in first.items()]
    return all(np.array_equal(*pair) for pair in pairs) and one.plant == other.plant


def _thin(points: tuple[Candidate, ...], most: int) -> tuple[Candidate, ...]:
    """Evenly many of a front, both ends among them."""
    if len(points) <= most:
        return points
    places = np.round(np.linspace(0, len(points) - 1, most)).astype(int)
    return tuple(points[place] for place in places.tolist())


def _choose(search: Search, points: tuple[Candidate, ...]) -> Candidate:
    """The point nearest to the best in all objectives, each in shares of what the baseline has."""
    measures = search.study.goals.minimise
    costs = np.array([[point.cost(measure) for measure in measures] for point in points])
    before = np.abs([search.baseline.figures[measure.name] for measure in measures])
    spans = np.maximum(np.ptp(costs, axis=0), 1e-300)
    scales = np.where(np.isfinite(before) & (before > 0.0), before, spans)
    distances = np.linalg.norm((costs - costs.min(axis=0)) / scales, axis=1)
    return points[int(np.argmin(distances))]


def _rigs(study: Study, rig: Rig, posterior: Posterior | None) -> list[Rig]:
    """The rig as known, the nominal one, the other explanations, and the study's own."""
    rigs = [rig]
    if posterior is not None:
        rigs.append(NOMINAL)
        for number, other in enumerate(posterior.otherwise):
            twice = any(one.effect == other.effect for one in posterior.otherwise[:number])
            name = f"twin with {other.effect} instead{f' ({number + 1})' if twice else ''}"
            rigs.append(replace(NOMINAL, name=name, certain=other.changes))
    for label, changes in study.other_rigs.items():
        rigs.append(replace(rig, name=f"rig with {label}", certain=changes))
    return rigs
