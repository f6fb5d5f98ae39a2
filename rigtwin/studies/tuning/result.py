"""Tuning of a whole study on the rig as known, and evaluation on scenarios the search did not use.

The evaluation covers the rig as known, the nominal rig, rigs of other explanations of a diagnosis,
and further rigs of the study.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.description.posterior import Posterior
from rigtwin.studies.tuning.bench import Bench, Score
from rigtwin.studies.tuning.candidates import Candidate, TuningSearch
from rigtwin.studies.tuning.evaluation import SettingsComparison, evaluate
from rigtwin.studies.tuning.parameter import Settings, set_values
from rigtwin.studies.tuning.scenario import (
    APART,
    NOMINAL,
    UncertainRig,
    calibrated_rig,
    draw_scenarios,
)
from rigtwin.studies.tuning.search import find_best, find_front
from rigtwin.studies.tuning.study import Study

TUNED, BEFORE, TUNED_NOMINAL = "tuned", "before", "tuned on the nominal twin"


@dataclass(frozen=True)
class TuningResult:
    """Results of a study.

    Parameters
    ----------
    study : Study
        The study.
    seed : int
        Seed of the search.
    rig : str
        Name of the rig the settings were tuned on.
    baseline : Score
        Score of the baseline settings over the search's scenarios.
    candidates : tuple of Candidate
        All candidates in the order in which they were tried.
    front : tuple of Candidate
        Pareto front of two objectives, thinned to the study's number of points. With one
        objective, only the best candidate.
    chosen : Candidate
        Recommended candidate; of a front, the one nearest to the best in both objectives.
    comparisons : tuple of SettingsComparison
        Comparisons of the chosen candidate on held-out scenarios.
    front_comparisons : tuple of SettingsComparison
        Comparisons of each point of a front with the baseline on held-out scenarios.
    same_scenarios : bool
        Whether scenarios differ only by sensor noise.
    """

    study: Study
    seed: int
    rig: str
    baseline: Score
    candidates: tuple[Candidate, ...]
    front: tuple[Candidate, ...]
    chosen: Candidate
    comparisons: tuple[SettingsComparison, ...]
    front_comparisons: tuple[SettingsComparison, ...]
    same_scenarios: bool = False

    @property
    def settings(self) -> Settings:
        """Tuned settings of the controller."""
        return settings_of(self.study, self.chosen)

    @property
    def main(self) -> SettingsComparison:
        """Comparison of the tuned settings with the baseline, on the rig they were tuned on."""
        return self.comparisons[0]


def settings_of(study: Study, candidate: Candidate) -> Settings:
    """Return the controller's settings with a candidate's values."""
    return set_values(study.configuration.controller, study.parameters, candidate.values)


def tune(
    bench: Bench,
    seed: int,
    posterior: Posterior | None = None,
    stage: Callable[[str], object] = lambda _: None,
) -> TuningResult:
    """Tune settings, and evaluate the result.

    Parameters
    ----------
    bench : Bench
        Runs of the study.
    seed : int
        Seed of the search.
    posterior : Posterior, optional
        Posterior of a diagnosis of the rig. Settings are then also tuned on the nominal twin, to
        show the benefit of the diagnosis, and the loss if it were wrong.
    stage : callable, optional
        Function called with the title of each stage as it begins.

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
    # Tuned settings are compared with the baseline, and with settings tuned without the diagnosis.
    rivals = [(BEFORE, study.baseline_settings)]
    if posterior is not None:
        stage(f"tuning on the {NOMINAL.name}")
        rivals.append((TUNED_NOMINAL, find_settings(bench, NOMINAL, seed)))
    comparisons = []
    after = (TUNED, settings_of(study, chosen))
    for candidate_rig in _rigs(study, rig, posterior):
        stage(f"evaluating on the {candidate_rig.name}")
        # APART separates the seeds, so that no held-out road was used by the search.
        scenarios = draw_scenarios(study, candidate_rig, study.budget.held_out, APART)
        comparisons += [
            evaluate(bench, candidate_rig.name, scenarios, rival, after) for rival in rivals
        ]
    front_comparisons = []
    if len(study.goals.minimise) == 2:
        stage("evaluating the front")
        front_comparisons = _compare_front(bench, rig, points, rivals[0])
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
        same_scenarios=_are_same(study, rig),
    )


def _compare_front(
    bench: Bench, rig: UncertainRig, points: tuple[Candidate, ...], baseline: tuple[str, Settings]
) -> list[SettingsComparison]:
    """Compare each point of a front with the baseline on held-out scenarios."""
    study = bench.study
    scenarios = draw_scenarios(study, rig, study.budget.held_out, APART)
    named = [(f"point {n}", settings_of(study, point)) for n, point in enumerate(points, start=1)]
    return [evaluate(bench, rig.name, scenarios, baseline, after) for after in named]


def count_runs(study: Study, posterior: Posterior | None) -> int:
    """Return about how many runs a tuning needs.

    Parameters
    ----------
    study : Study
        Study to be tuned.
    posterior : Posterior or None
        Posterior of a diagnosis of the rig, if the settings are tuned on a calibrated twin.
    """
    budget = study.budget
    searches = 1 if posterior is None else 2
    rigs = 1 + len(study.other_rigs) + (0 if posterior is None else 1 + len(posterior.alternatives))
    points = budget.points if len(study.goals.minimise) == 2 else 0
    tried = searches * (budget.evaluations + 1) * budget.roads
    return tried + budget.held_out * (rigs * (1 + searches) + points)


def find_settings(bench: Bench, rig: UncertainRig, seed: int) -> Settings:
    """Tune settings on a rig without evaluation. Raise RigtwinError if no candidate is allowed."""
    return settings_of(bench.study, _choose(*_search(bench, rig, seed)))


def _search(
    bench: Bench, rig: UncertainRig, seed: int
) -> tuple[TuningSearch, tuple[Candidate, ...]]:
    scenarios = draw_scenarios(bench.study, rig, bench.study.budget.roads, 0)
    search = TuningSearch(bench, scenarios, seed)
    if len(bench.study.goals.minimise) == 1:
        return search, (find_best(search),)
    return search, find_front(search)


def _are_same(study: Study, rig: UncertainRig) -> bool:
    """Return whether neither road nor rig differs between two scenarios."""
    configuration, demands = study.search_configuration, study.experiment.demands
    scenarios = draw_scenarios(study, rig, 2, APART)
    # Demands that ignore the seed give the same road in both.
    first, second = (demands(configuration, seed) for seed in (0, APART))
    pairs = [(first, second)]
    if isinstance(first, Mapping):
        pairs = [(signal, second[name]) for name, signal in first.items()]
    return all(np.array_equal(*pair) for pair in pairs) and (
        scenarios[0].plant == scenarios[1].plant
    )


def _thin(points: tuple[Candidate, ...], most: int) -> tuple[Candidate, ...]:
    """Return evenly spaced points of a front, including both ends."""
    if len(points) <= most:
        return points
    places = np.round(np.linspace(0, len(points) - 1, most)).astype(int)
    return tuple(points[place] for place in places.tolist())


def _choose(search: TuningSearch, points: tuple[Candidate, ...]) -> Candidate:
    """Return the point nearest to the ideal, each objective as a share of the baseline's figure.

    The ideal point has the best value of every objective, which no candidate reaches at once.
    """
    measures = search.study.goals.minimise
    costs = np.array([[point.cost(measure) for measure in measures] for point in points])
    before = np.abs([search.baseline.figures[measure.name] for measure in measures])
    # Where the baseline has no positive figure, the front's own extent is the scale.
    spans = np.maximum(np.ptp(costs, axis=0), 1e-300)
    scales = np.where(np.isfinite(before) & (before > 0.0), before, spans)
    distances = np.linalg.norm((costs - costs.min(axis=0)) / scales, axis=1)
    return points[int(np.argmin(distances))]


def _rigs(study: Study, rig: UncertainRig, posterior: Posterior | None) -> list[UncertainRig]:
    """Return the rigs to evaluate on: as known, nominal, alternatives, and the study's own."""
    rigs = [rig]
    if posterior is not None:
        rigs.append(NOMINAL)
        for number, explanation in enumerate(posterior.alternatives):
            effect = explanation.effect
            repeated = any(e.effect == effect for e in posterior.alternatives[:number])
            name = f"twin with {effect} instead{f' ({number + 1})' if repeated else ''}"
            rigs.append(replace(NOMINAL, name=name, certain=explanation.changes))
    for label, changes in study.other_rigs.items():
        rigs.append(replace(rig, name=f"rig with {label}", certain=changes))
    return rigs
