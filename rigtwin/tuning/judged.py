"""What tuned settings are worth on roads and rigs that the search has not seen, run beside the settings begun with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from controllers import Settings
from rigtwin.arrays import Array
from rigtwin.safety import Trip
from rigtwin.tuning.bench import Bench
from rigtwin.tuning.measures import Measure
from rigtwin.tuning.run import LIMITS, TRIP
from rigtwin.tuning.scenario import Scenario

Figures = Mapping[str, float]
"""Of a run: name → figure, as `rigtwin.tuning.run` gives it."""


@dataclass(frozen=True)
class Spread:
    """Median, and the 5 and 95 % quantiles, over scenarios."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class Change:
    """How a measure changed in the same scenario, in % of before, or in its unit where it can pass zero. median with its 95 %
    interval; better: share of scenarios in which it did not get worse."""

    measure: Measure
    before: Spread
    after: Spread
    median: float
    low: float
    high: float
    better: float
    relative: bool


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
    """Of the median of whatever the values are drawn from: the order statistics that the binomial distribution says."""
    ordered, count = np.sort(values), len(values)
    rank = int(binom.ppf((1.0 - confidence) / 2.0, count, 0.5))
    # Between the rank-th from below and from above lies the median with at least the confidence, or all of them.
    rank = max(rank, 1)
    return float(ordered[rank - 1]), float(ordered[count - rank])


def compared(
    bench: Bench, rig: str, scenarios: Sequence[Scenario], before: tuple[str, Settings], after: tuple[str, Settings]
) -> Comparison:
    """Both settings, each with its name, in every scenario."""
    first, second = bench.runs(bench.study.configuration, [before[1], after[1]], scenarios)
    return comparison(bench.study.measures, rig, (before[0], first), (after[0], second))


def comparison(
    measures: Sequence[Measure], rig: str, before: tuple[str, Sequence[Figures]], after: tuple[str, Sequence[Figures]]
) -> Comparison:
    """Of runs of both settings, each with its name, in the same scenarios."""
    (against, first), (settings, second) = before, after
    fine = [a[TRIP] == Trip.NONE and b[TRIP] == Trip.NONE for a, b in zip(first, second, strict=True)]
    changes = []
    for measure in measures if any(fine) else ():
        one, other = (
            np.array([row[measure.name] for row, ok in zip(rows, fine, strict=True) if ok]) for rows in (first, second)
        )
        relative = not measure.more
        change = 100.0 * (other / one - 1.0) if relative else other - one
        worse = change < 0.0 if measure.more else change > 0.0
        low, high = median_interval(change)
        better = float(np.mean(~worse))
        changes.append(Change(measure, spread(one), spread(other), float(np.median(change)), low, high, better, relative))
    trips = tuple(float(np.mean([row[TRIP] != Trip.NONE for row in rows])) for rows in (first, second))
    limits = max(row[LIMITS] for row in second)
    return Comparison(rig, settings, against, tuple(changes), (trips[0], trips[1]), limits, int(sum(fine)))
