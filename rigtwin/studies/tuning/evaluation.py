"""What tuned settings are worth on roads and rigs that the search has not seen.

They are run beside the settings that they are compared with, in the same scenarios.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import Trip
from rigtwin.studies.tuning.bench import Bench, quantile
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import Settings
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

    @staticmethod
    def of(values: Array) -> Spread:
        """The spread of a measure's values, one a scenario."""
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        return Spread(float(middle), float(low), float(high))


@dataclass(frozen=True)
class Change:
    """How a measure changed in the same scenario.

    Parameters
    ----------
    measure : Measure
        What changed.
    before, after : Spread
        Over scenarios.
    median, low, high : float
        Of the change, with the median's 95 % interval, which is not numbers below six runs.
    better : float
        Share of scenarios in which it did not get worse.
    relative : bool
        Whether the change is in % of before, or in the measure's unit, where it can be zero.
    quantile : float
        The study's quantile of it after.
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
        """Whether its interval lies on the better side."""
        return self.low > 0.0 if self.measure.more else self.high < 0.0


@dataclass(frozen=True)
class Comparison:
    """Settings against others over the same scenarios.

    Parameters
    ----------
    rig, settings, against : str
        Names of the rig, the settings, and those that they are compared with.
    changes : tuple of Change
        One a measure; none where no runs are left to compare.
    trips : tuple of float
        Share of runs that tripped, before and after.
    limits : float
        The largest share of a safety limit that the settings reached.
    runs : int
        Those compared, in which neither tripped.
    """

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


def median_interval(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of the median of whatever the values are drawn from.

    The ends are the order statistics that the binomial distribution says; not numbers where even
    the extremes do not hold the median so often.
    """
    ordered, count = np.sort(values), len(values)
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
) -> Comparison:
    """Run both settings, each with its name, in every scenario, and compare them."""
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
) -> Comparison:
    """Compare runs of two settings in the same scenarios.

    Parameters
    ----------
    measures : sequence of Measure
        What is compared.
    rig : str
        Name of the rig that was run.
    before, after : (str, sequence of mapping)
        Name of the settings, and the figures of their run in each scenario.
    share : float, optional
        The quantile that the settings are scored by.
    """
    (against, first), (settings, second) = before, after
    pairs = list(zip(first, second, strict=True))
    complete = [pair for pair in pairs if all(_is_complete(run, measures) for run in pair)]
    trips = [float(np.mean([run[TRIP] != Trip.NONE for run in runs])) for runs in (first, second)]
    changes = [_change(each, complete, share) for each in measures] if complete else []
    return Comparison(
        rig=rig,
        settings=settings,
        against=against,
        changes=tuple(changes),
        trips=(trips[0], trips[1]),
        limits=max(run[LIMITS] for run in second),
        runs=len(complete),
    )


def _change(measure: Measure, pairs: Sequence[tuple[Figures, Figures]], share: float) -> Change:
    before, after = (np.array([pair[side][measure.name] for pair in pairs]) for side in (0, 1))
    relative = not measure.more and bool(np.all(before > 0.0))
    change = 100.0 * (after / before - 1.0) if relative else after - before
    worse = change < 0.0 if measure.more else change > 0.0
    low, high = median_interval(change)
    return Change(
        measure=measure,
        before=Spread.of(before),
        after=Spread.of(after),
        median=float(np.median(change)),
        low=low,
        high=high,
        better=float(np.mean(~worse)),
        relative=relative,
        quantile=quantile(measure, after, share),
    )


def _is_complete(run: Figures, measures: Sequence[Measure]) -> bool:
    """Whether a run lived to show every measure."""
    return run[TRIP] == Trip.NONE and all(math.isfinite(run[each.name]) for each in measures)
