"""Time base of a recording: repeated rows, period of the time stamps, even ticks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

JITTER = 0.5
"""Share of the period by which a time stamp may be off."""
MOST_OFF = 5.0
"""Largest distance of a time stamp from even ticks, in periods: rows that wait in a buffer come in
bursts."""
HELD, FEWEST_OF_SPLINE = 0.5, 8
"""Share of repeated values from which a signal is held from row to row rather than sampled, and
smallest number of rows of a spline."""
PLAUSIBLE = (1e-5, 0.1)
"""s; periods that a time column without a unit may have in seconds."""
POSSIBLE = (1e-6, 10.0)
"""s; periods that a recording may have."""
MOST_VALUES = 300_000_000
"""Largest number of values, ticks times signals, that resampling makes: 2.4 GB."""
COLUMN_UNITS = ("d", "h", "min", "ms", "us", "ns")
"""Units that a time column may be in, apart from seconds."""
Signals = Mapping[str, Array]
"""Name → shape (rows,)."""


def drop_repeats(time: Array, signals: Signals, report: list[str]) -> tuple[Array, Signals]:
    """Return time and signals without repeated rows, whose number is added to the report.

    Raises RigtwinError if time goes back, or if rows of the same time have different values.
    """
    steps = np.diff(time)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0)) + 2
        raise RigtwinError(
            f"time goes back in row {row}, from {time[row - 2]:g} s to {time[row - 1]:g} s"
        )
    again = np.concatenate([[False], steps == 0])
    if not again.any():
        return time, signals
    for name, values in signals.items():
        unlike = again[1:] & (np.diff(values) != 0)
        if unlike.any():
            row = int(np.argmax(unlike)) + 2
            raise RigtwinError(
                f"row {row} has the same time as the one before, "
                f"but another value of {name!r}; expected each time once "
                "(is the time column's resolution too coarse? then give [time] period instead)"
            )
    report.append(f"{int(again.sum())} rows were there twice and are left out")
    return time[~again], {name: values[~again] for name, values in signals.items()}


def find_period(time: Array) -> float:
    """Return the period of time stamps, s, rounded as far as the stamps allow."""
    # The median is robust against gaps; the mean of the regular steps averages out jitter.
    steps = np.diff(time)
    typical = float(np.median(steps))
    regular = np.abs(steps - typical) < JITTER * typical
    period = float(np.mean(steps[regular]))
    # The stamps allow a rounding that moves the last of them by less than the jitter.
    for digits in range(1, 8):
        rounded = float(f"{period:.{digits}g}")
        if (
            abs(rounded - period) * len(time) < JITTER * period
            and abs(rounded / period - 1.0) < 1e-3
        ):
            return rounded
    return period


def require_plausible(period: float, said: bool) -> None:
    """Refuse a period that no test has, or that a unit explains which nobody stated.

    Parameters
    ----------
    period
        Period of the time column, s.
    said
        Whether the file or the map states the column's unit.

    Raises
    ------
    RigtwinError
        If the period is implausible; the message names the units in which it would be plausible.
    """
    low, high = POSSIBLE if said else PLAUSIBLE
    if low <= period <= high:
        return
    factors = {unit: unit_of(unit)[1] for unit in COLUMN_UNITS}
    fits = [
        f'"{unit}" (a step of {factor * period:.3g} s)'
        for unit, factor in factors.items()
        if PLAUSIBLE[0] <= factor * period <= PLAUSIBLE[1]
    ]
    if said:
        hint = "is the unit right?"
    else:
        hint = "say [time] unit in the map" + (f", such as {' or '.join(fits)}" if fits else "")
        hint += '; "s" if it is in seconds' if POSSIBLE[0] <= period <= POSSIBLE[1] else ""
    raise RigtwinError(
        f"the time column's step is {period:.4g} s{'' if said else ' if it is in seconds'}; "
        f"expected {low:g} to {high:g} s; {hint}"
    )


def most_off(time: Array) -> float:
    """Return the largest distance of time stamps from even ticks between the first and last, s."""
    return float(np.max(np.abs(time - np.linspace(time[0], time[-1], len(time)))))


def require_even_ticks(time: Array, period: float, report: list[str]) -> None:
    """Raise RigtwinError if the time stamps have gaps; report their drift and jitter."""
    steps = np.diff(time)
    off = np.abs(steps - period) > JITTER * period
    if off.any():
        at = int(np.argmax(off))
        raise RigtwinError(
            f"{int(off.sum())} gaps in time, the first of {steps[at]:.4g} s at "
            f"{time[at] - time[0]:.4g} s where {period:g} s is the rule; take a stretch without "
            f"them by [time] start and until, or say [time] resample = {period:g}"
        )
    if (late := most_off(time)) > MOST_OFF * period:
        raise RigtwinError(
            f"time stamps are up to {late:.3g} s from even ticks, as where the rate changes within "
            f"the log; take a stretch of one rate by [time] start and until, or say [time] "
            f"resample = {period:g}"
        )
    drift = abs((time[-1] - time[0]) / (len(time) - 1) - period)
    # The drift over the whole test counts, not that of one period.
    if drift * len(time) > JITTER * period:
        report.append(
            f"time stamps drift: on average every {(time[-1] - time[0]) / (len(time) - 1):.6g} s, "
            f"mostly {period:g} s"
        )
    worst = float(np.max(np.abs(steps - period)))
    if worst > 0.01 * period:
        report.append(f"time stamps are off by up to {worst:.2g} s; taken as ticks of {period:g} s")


def is_held(values: Array) -> bool:
    """Return whether most values of a signal repeat the one before, as those of a command."""
    return bool(np.mean(np.diff(values) == 0.0) > HELD)


def interpolate(time: Array, values: Array, ticks: Array, longest: float) -> Array:
    """Return a signal between its rows: by a cubic spline, and straight where it would overshoot.

    A straight line between two rows averages their noise, so that the noise of the result looks
    half as strong as it is at low frequencies. Held values, as those of commands, and steps longer
    than `longest`, s, stay straight.
    """
    straight = np.interp(ticks, time, values)
    if len(values) < FEWEST_OF_SPLINE or is_held(values):
        return straight
    from scipy.interpolate import make_interp_spline

    smooth = make_interp_spline(time, values, k=3)(ticks)
    following = np.clip(np.searchsorted(time, ticks), 1, len(time) - 1)
    return np.where(np.diff(time)[following - 1] > longest, straight, smooth)


def resample(
    time: Array, signals: Signals, period: float, wanted: float, report: list[str]
) -> tuple[Array, Signals]:
    """Return time and signals at another period; report bridged gaps.

    A low pass runs first where the new period is longer, so that nothing is aliased. Raises
    RigtwinError if that makes more values than fit into memory.
    """
    ticks = (time[-1] - time[0]) / wanted
    if ticks * (len(signals) + 1) > MOST_VALUES:
        raise RigtwinError(
            f"[time] resample = {wanted:g} s makes {ticks:.3g} ticks of {len(signals)} signals in "
            f"{time[-1] - time[0]:.4g} s; expected at most {MOST_VALUES:g} values; take a stretch "
            "by [time] start and until"
        )
    bridged = np.diff(time)
    bridged = bridged[bridged > (1.0 + JITTER) * period]
    if len(bridged):
        report.append(
            f"{len(bridged)} gaps are bridged straight, the longest of {bridged.max():.4g} s, "
            f"{bridged.sum():.4g} s in all"
        )
    # Importing scipy.signal takes a second, which only this function pays for.
    from scipy.signal import butter, sosfiltfilt

    ticks = np.arange(int((time[-1] - time[0]) / wanted + 1e-6) + 1) * wanted + time[0]
    resampled = {}
    for name, values in signals.items():
        # Without delay, by filtering both ways: channels must stay in phase with each other. A
        # short signal has not enough samples for the filter to settle.
        if wanted > 1.5 * period and len(values) > 60:
            values = sosfiltfilt(butter(4, 0.8 * period / wanted, output="sos"), values)
        resampled[name] = interpolate(time, values, ticks, (1.0 + JITTER) * period)
    report.append(f"resampled from {period:g} s to {wanted:g} s: {len(ticks)} ticks")
    return ticks, resampled
