"""Runs candidates in scenarios, each once, and says what they are worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from controllers import Settings
from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import Trip
from rigtwin.studies.sweep import Store, Workers, run_jobs
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.run import LIMITS, TRIP, Run, run
from rigtwin.studies.tuning.scenario import Scenario
from rigtwin.studies.tuning.study import Study


@dataclass(frozen=True)
class Worth:
    """What a candidate is worth over scenarios. figures: measure → the study's quantile of it, not a number if any run
    tripped; limits: the largest share of a safety limit in any run; trips: share of runs that tripped."""

    figures: dict[str, float]
    limits: float
    trips: float


@dataclass(frozen=True)
class Bench:
    """Where the runs of one study are made and kept. progress: called with 1 for each run."""

    study: Study
    store: Store
    workers: Workers
    progress: Callable[[int], object] = lambda _: None

    def runs(
        self, base: Configuration, candidates: Sequence[Settings], scenarios: Sequence[Scenario]
    ) -> list[list[dict[str, float]]]:
        """What each candidate's run in each scenario came to: name → figure, as `run` gives it."""
        names = tuple(measure.name for measure in self.study.measures)

        def asked(candidate: Settings, scenario: Scenario) -> Run:
            configuration = base._replace(controller=candidate, plant=scenario.plant)
            return Run(self.study.experiment, configuration, scenario.seed, self.study.first, names)

        jobs = [[asked(candidate, scenario) for scenario in scenarios] for candidate in candidates]
        keys = [[job.key for job in row] for row in jobs]
        together = (pair for row, own in zip(keys, jobs, strict=True) for pair in zip(row, own, strict=True))
        run_jobs(self.store, self.workers, run, together, self.progress)
        return [[self.store[key] for key in row] for row in keys]

    def searched(self, candidates: Sequence[Settings], scenarios: Sequence[Scenario]) -> list[Worth]:
        """What each candidate is worth to the search."""
        return [self._worth(rows) for rows in self.runs(self.study.searched, candidates, scenarios)]

    def _worth(self, rows: Sequence[dict[str, float]]) -> Worth:
        figures = {
            each.name: quantile(each, [row[each.name] for row in rows], self.study.quantile) for each in self.study.measures
        }
        trips = float(np.mean([row[TRIP] != Trip.NONE for row in rows]))
        return Worth(figures, max(row[LIMITS] for row in rows), trips)


def quantile(measure: Measure, values: Sequence[float] | Array, share: float) -> float:
    """The value that this share of runs is no worse than; not a number if any is none."""
    numbers = np.asarray(values, dtype=float)
    if np.isnan(numbers).any():
        return float("nan")
    return float(np.quantile(numbers, 1.0 - share if measure.more else share))
