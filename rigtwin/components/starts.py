"""Values from which a search for an effect starts, by the scales of the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rigtwin.components.effect import Context, Guess, Starts
from rigtwin.components.scales import Scales

LEAST_CHANGE = 1e-3
"""Smallest unit of the changes in a search, as a share of the nominal value."""
LONGEST_LAG = 2.0
"""Longest lag or delay of a force's reading, in characteristic times of the motion."""


def fixed_starts(values: Sequence[float], step: float) -> Guess:
    """Return a guess of fixed values, whatever the recording."""
    return lambda _: Starts.single(values, step)


def shares_of_nominal(shares: Sequence[float], step: float) -> Guess:
    """Return a guess of shares of the nominal value."""

    def guess(at: Context) -> Starts:
        nominal = at.nominal
        return Starts.single([nominal * share for share in shares], abs(nominal) * step)

    return guess


def around_nominal(size: Callable[[Scales], float], shares: Sequence[float], step: float) -> Guess:
    """Return a guess of the nominal value plus shares of the motion's size, within bounds."""

    def guess(at: Context) -> Starts:
        meaning = at.effect.quantities()[at.effect.kind.parameters[0]]
        nominal = at.nominal
        # A change that rounding hides beside a large nominal value is none.
        unit = max(size(at.scales), LEAST_CHANGE * abs(nominal))
        values = [min(max(nominal + share * unit, meaning.low), meaning.high) for share in shares]
        return Starts.single([v for v in dict.fromkeys(values) if v != nominal], step * unit)

    return guess


def at_limits(values: Sequence[float], least: float) -> Starts:
    """Return starts of a limit at these values, none of them below `least`."""
    tried = tuple(dict.fromkeys(max(value, 1e-3 * max(values), least) for value in values))
    return Starts.single(tried, 0.004 * max(float(np.median(tried)), least))


def late_starts(context: Context) -> Starts:
    """Return starts of a lag or delay: a few ticks, and shares of the motion's own time."""
    scales = context.scales
    times = {ticks * scales.period for ticks in (0.5, 2.0, 6.0)} | {
        share * scales.time for share in (0.012, 0.05, 0.15)
    }
    return Starts.single(sorted(times), min(0.001 * scales.time, 0.25 * scales.period))


def late_or_early_starts(context: Context) -> Starts:
    """Return starts of either sign: a negative lag is a force that acts later than recorded.

    A lag that is much longer than the motion's own time leaves nothing of a signal. It would
    explain any constant reading.
    """
    late = late_starts(context)
    times = [time for (time,) in late.values]
    longest = LONGEST_LAG * context.scales.time
    values = tuple((time,) for time in (*(-time for time in times[:3]), *times))
    return Starts(values, late.steps, bounds=((-longest, longest),))
