"""Simulates candidates in scenarios, each pair once, and scores them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.trip import Trip
from rigtwin.studies.sweep import Store, Workers, run_jobs
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import Settings
from rigtwin.studies.tuning.run import LIMITS, TRIP, Run, run
from rigtwin.studies.tuning.scenario import Scenario
from rigtwin.studies.tuning.study import Study


@dataclass(frozen=True)
class Score:
    """Score of a candidate over scenarios.

    Parameters
    ----------
    figures : dict
        Measure → the study's quantile of it; NaN if any run tripped.
    limits : float
        Largest share of a safety limit reached in any run.
    trips : float
        Share of the runs that tripped.
    """

    figures: dict[str, float]
    limits: float
    trips: float


@dataclass(frozen=True)
class Bench:
    """Runs of one study: what is run, by whom, and where results are stored.

    Parameters
    ----------
    study : Study
        Study that the runs belong to.
    store : Store
        Store of the results.
    workers : Workers
        Workers that simulate the runs.
    progress : callable, optional
        Function called with 1 for each run.
    """

    study: Study
    store: Store
    workers: Workers
    progress: Callable[[int], object] = lambda _: None

    def plan(self, base: Configuration, candidate: Settings, scenario: Scenario) -> Run:
        """Return the run of a candidate in a scenario, with `base` for everything else."""
        return Run(
            machine=str(self.study.machine.path),
            experiment=self.study.experiment,
            # The candidate is the controller, the scenario is the plant; all else is the study's.
            configuration=base._replace(controller=candidate, plant=scenario.plant),
            seed=scenario.seed,
            first=self.study.first,
            measures=self.study.goals.measures,
        )

    def run(
        self, base: Configuration, candidates: Sequence[Settings], scenarios: Sequence[Scenario]
    ) -> list[list[dict[str, float]]]:
        """Simulate every candidate in every scenario.

        Parameters
        ----------
        base : Configuration
            Configuration of everything but controller and plant.
        candidates : sequence of Settings
            Settings of the controller.
        scenarios : sequence of Scenario
            Roads, noise and rigs.

        Returns
        -------
        list
            One row per candidate; for each scenario the figures by name, as `run.run` returns them.
        """
        jobs = [
            [self.plan(base, candidate, scenario) for scenario in scenarios]
            for candidate in candidates
        ]
        keys = [[job.key for job in row] for row in jobs]
        flat = zip(chain.from_iterable(keys), chain.from_iterable(jobs), strict=True)
        run_jobs(self.store, self.workers, run, flat, self.progress)
        return [[self.store[key] for key in row] for row in keys]

    def score(self, candidates: Sequence[Settings], scenarios: Sequence[Scenario]) -> list[Score]:
        """Score candidates over scenarios of the search."""
        rows = self.run(self.study.search_configuration, candidates, scenarios)
        return [self._score(row) for row in rows]

    def _score(self, runs: Sequence[dict[str, float]]) -> Score:
        """Summarise the runs of one candidate."""
        figures = {}
        for measure in self.study.goals.measures:
            values = [run[measure.name] for run in runs]
            figures[measure.name] = quantile(measure, values, self.study.quantile)
        trips = float(np.mean([run[TRIP] != Trip.NONE for run in runs]))
        return Score(figures, max(run[LIMITS] for run in runs), trips)


def quantile(measure: Measure, values: Sequence[float] | Array, share: float) -> float:
    """Return the value that a share of the runs is no worse than; NaN if any value is NaN."""
    numbers = np.asarray(values, dtype=float)
    if np.isnan(numbers).any():
        # One trip makes the figure NaN: a candidate that trips has no score.
        return float("nan")
    return float(np.quantile(numbers, 1.0 - share if measure.more else share))
