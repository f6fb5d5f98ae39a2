"""Evaluation of tuned settings on roads and rigs that the search did not use.

Tuned settings and the settings they are compared with run in the same scenarios.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from rigtwin.numerics.arrays import Array
from rigtwin.simulation.trip import Trip
from rigtwin.studies.tuning.bench import Bench, quantile
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import Settings
from rigtwin.studies.tuning.run import LIMITS, TRIP
from rigtwin.studies.tuning.scenario import Scenario

Figures = Mapping[str, float]
"""Figures of a run by name, as `rigtwin.studies.tuning.run` returns them."""


@dataclass(frozen=True)
class Spread:
    """Median, 5 % and 95 % quantile over scenarios."""

    median: float
    low: float
    high: float

    @staticmethod
    def from_values(values: Array) -> Spread:
        """Return the spread of a measure's values, one value per scenario."""
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        return Spread(float(middle), float(low), float(high))


@dataclass(frozen=True)
class MeasureChange:
    """Change of a measure between two settings in the same scenarios.

    Parameters
    ----------
    measure : Measure
        Measure that changed.
    before, after : Spread
        Spread over scenarios with either settings.
    median, low, high : float
        Median of the change, and the 95 % interval of the median; NaN for fewer than six runs.
    better : float
        Share of scenarios in which the measure did not get worse.
    relative : bool
        Whether the change is in % of `before`; otherwise it is in the measure's unit, because
        `before` can be zero.
    quantile : float
        The study's quantile of the measure after the change.
    """

    measure: Measure
    before: Spread
    after: Spread
    median: float
    low: float
    high: float
    better: float
    relative: bool
    quantile: float

    @property
    def improved(self) -> bool:
        """Whether the interval of the change lies on the better side of zero."""
        return self.low > 0.0 if self.measure.more else self.high < 0.0


@dataclass(frozen=True)
class SettingsComparison:
    """Comparison of two settings over the same scenarios.

    Parameters
    ----------
    rig, settings, against : str
        Names of the rig, of the settings, and of the settings they are compared with.
    changes : tuple of MeasureChange
        One change per measure; none if no runs remain to compare.
    trips : tuple of float
        Share of the runs that tripped, before and after.
    limits : float
        Largest share of a safety limit reached with the settings.
    runs : int
        Number of compared runs, in which neither settings tripped.
    """

    rig: str
    settings: str
    against: str
    changes: tuple[MeasureChange, ...]
    trips: tuple[float, float]
    limits: float
    runs: int

    def change_of(self, name: str) -> MeasureChange:
        """Return the change of the named measure."""
        return next(change for change in self.changes if change.measure.name == name)


def median_interval(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Return a confidence interval of the median of the values' distribution.

    The number of values below the median has the binomial distribution B(n, 1/2), whatever the
    values' distribution. The ends are the order statistics it selects. NaN if even the extremes
    do not reach the confidence.
    """
    ordered, count = np.sort(values), len(values)
    # P(median below the rank-th value) = P(B(n, 1/2) < rank).
    rank = int(binom.ppf((1.0 - confidence) / 2.0, count, 0.5))
    if rank < 1:
        return math.nan, math.nan
    return float(ordered[rank - 1]), float(ordered[count - rank])


def evaluate(
    bench: Bench,
    rig: str,
    scenarios: Sequence[Scenario],
    before: tuple[str, Settings],
    after: tuple[str, Settings],
) -> SettingsComparison:
    """Run two settings, each given with its name, in every scenario, and compare them."""
    study = bench.study
    first, second = bench.run(study.configuration, [before[1], after[1]], scenarios)
    measures = study.goals.measures
    return compare(measures, rig, (before[0], first), (after[0], second), study.quantile)


def compare(
    measures: Sequence[Measure],
    rig: str,
    before: tuple[str, Sequence[Figures]],
    after: tuple[str, Sequence[Figures]],
    share: float = 0.5,
) -> SettingsComparison:
    """Compare the runs of two settings in the same scenarios.

    Parameters
    ----------
    measures : sequence of Measure
        Measures that are compared.
    rig : str
        Name of the rig.
    before, after : (str, sequence of mapping)
        Name of the settings, and the figures of their run in each scenario.
    share : float, optional
        Quantile that the settings are scored by.
    """
    (against, first), (settings, second) = before, after
    pairs = list(zip(first, second, strict=True))
    # A run that tripped has no figures, so its scenario is left out for both settings.
    complete = [pair for pair in pairs if all(_is_complete(run, measures) for run in pair)]
    trips = [float(np.mean([run[TRIP] != Trip.NONE for run in runs])) for runs in (first, second)]
    changes = [_change(measure, complete, share) for measure in measures] if complete else []
    return SettingsComparison(
        rig=rig,
        settings=settings,
        against=against,
        changes=tuple(changes),
        trips=(trips[0], trips[1]),
        limits=max(run[LIMITS] for run in second),
        runs=len(complete),
    )


def _change(
    measure: Measure, pairs: Sequence[tuple[Figures, Figures]], share: float
) -> MeasureChange:
    """Return the change of one measure over pairs of runs in the same scenario."""
    before, after = (np.array([pair[side][measure.name] for pair in pairs]) for side in (0, 1))
    # Pairing removes the scatter between roads: the median is that of the changes, not the change
    # of the medians.
    # A change in percent needs a positive figure to relate to in every scenario.
    relative = not measure.more and bool(np.all(before > 0.0))
    change = 100.0 * (after / before - 1.0) if relative else after - before
    worse = change < 0.0 if measure.more else change > 0.0
    low, high = median_interval(change)
    return MeasureChange(
        measure=measure,
        before=Spread.from_values(before),
        after=Spread.from_values(after),
        median=float(np.median(change)),
        low=low,
        high=high,
        better=float(np.mean(~worse)),
        relative=relative,
        quantile=quantile(measure, after, share),
    )


def _is_complete(run: Figures, measures: Sequence[Measure]) -> bool:
    """Return whether a run did not trip and has a finite figure for every measure."""
    return run[TRIP] == Trip.NONE and all(math.isfinite(run[measure.name]) for measure in measures)
