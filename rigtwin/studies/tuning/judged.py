"""What tuned settings are worth on roads and rigs that the search has not seen, run beside the settings begun with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from controllers import Settings
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import Trip
from rigtwin.studies.tuning.bench import Bench, quantile
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.run import LIMITS, TRIP
from rigtwin.studies.tuning.scenario import Scenario

Figures = Mapping[str, float]
"""Of a run: name → figure, as `rigtwin.studies.tuning.run` gives it."""


@dataclass(frozen=True)
class Spread:
    """Median, and the 5 and 95 % quantiles, over scenarios."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class Change:
    """How a measure changed in the same scenario, in % of before, or in its unit where it can be zero. median with its 95 %
    interval, not numbers below six runs; better: share of scenarios in which it did not get worse; worth: the study's quantile
    of it after."""

    measure: Measure
    before: Spread
    after: Spread
    median: float
    low: float
    high: float
    better: float
    relative: bool
    worth: float

    @property
    def improved(self) -> bool:
        """Whether its interval lies on the better side."""
        return self.low > 0.0 if self.measure.more else self.high < 0.0


@dataclass(frozen=True)
class Comparison:
    """Settings against others over the same scenarios. trips: share of runs that tripped, before and after; limits: the largest
    share of a safety limit that the settings reached; runs: those compared, in which neither tripped."""

    rig: str
    settings: str
    against: str
    changes: tuple[Change, ...]
    trips: tuple[float, float]
    limits: float
    runs: int

    def of(self, name: str) -> Change:
        """The change of a measure by name."""
        return next(change for change in self.changes if change.measure.name == name)


def spread(values: Array) -> Spread:
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return Spread(float(middle), float(low), float(high))


def median_interval(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Of the median of whatever the values are drawn from: the order statistics that the binomial distribution says. Not
    numbers where even the extremes do not hold it so often."""
    ordered, count = np.sort(values), len(values)
    rank = int(binom.ppf((1.0 - confidence) / 2.0, count, 0.5))
    if rank < 1:
        return math.nan, math.nan
    return float(ordered[rank - 1]), float(ordered[count - rank])


def compared(
    bench: Bench, rig: str, scenarios: Sequence[Scenario], before: tuple[str, Settings], after: tuple[str, Settings]
) -> Comparison:
    """Both settings, each with its name, in every scenario."""
    first, second = bench.runs(bench.study.configuration, [before[1], after[1]], scenarios)
    return comparison(bench.study.measures, rig, (before[0], first), (after[0], second), bench.study.quantile)


def comparison(
    measures: Sequence[Measure],
    rig: str,
    before: tuple[str, Sequence[Figures]],
    after: tuple[str, Sequence[Figures]],
    share: float = 0.5,
) -> Comparison:
    """Of runs of both settings, each with its name, in the same scenarios. share: quantile that the settings are worth."""
    (against, first), (settings, second) = before, after
    fine = [all(_lived(row, measures) for row in pair) for pair in zip(first, second, strict=True)]
    changes = []
    for measure in measures if any(fine) else ():
        one, other = (
            np.array([row[measure.name] for row, ok in zip(rows, fine, strict=True) if ok]) for rows in (first, second)
        )
        relative = not measure.more and bool(np.all(one > 0.0))
        change = 100.0 * (other / one - 1.0) if relative else other - one
        worse = change < 0.0 if measure.more else change > 0.0
        interval, worth = median_interval(change), quantile(measure, other, share)
        better = float(np.mean(~worse))
        middle = float(np.median(change))
        changes.append(Change(measure, spread(one), spread(other), middle, *interval, better, relative, worth))
    trips = tuple(float(np.mean([row[TRIP] != Trip.NONE for row in rows])) for rows in (first, second))
    limits = max(row[LIMITS] for row in second)
    return Comparison(rig, settings, against, tuple(changes), (trips[0], trips[1]), limits, int(sum(fine)))


def _lived(row: Figures, measures: Sequence[Measure]) -> bool:
    return row[TRIP] == Trip.NONE and all(math.isfinite(row[measure.name]) for measure in measures)
