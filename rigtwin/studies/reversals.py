"""Reversals of the motor in a recording, and the jumps of the force at them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controllers.force import MOTOR_CONSTANT
from controllers.friction import MAINS, MOTOR_LAG
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.studies.friction_loop import filter_lag

SEPARATION = 0.05
"""Minimum time between reversals that are used to measure the jump, in s."""
SMOOTHING = 0.008
"""Standard deviation of the Gaussian that smooths the travel before reversals are located, in s.
The filter is symmetric in time, so it adds no lag."""
MIN_REVERSALS = 8
"""Minimum number of reversals."""
LEAST_FRICTION, MOST_FRICTION = 0.5, 500.0
"""Range of a plausible Coulomb force, in N. A jump outside is noise or a fault."""


def _without_hum(signal: Array, time: Array) -> Array:
    """Return the signal without its component at mains frequency, fitted by least squares."""
    # Sine and cosine at the nominal frequency: amplitude and phase follow from a linear fit.
    turn = 2 * np.pi * MAINS * time
    waves = np.column_stack([np.sin(turn), np.cos(turn)])
    return signal - waves @ np.linalg.lstsq(waves, signal - signal.mean(), rcond=None)[0]


def reversals(recording: RecordedTest) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Locate the reversals of the motor.

    Returns
    -------
    tuple of three arrays
        Ticks of the isolated reversals, at least `SEPARATION` from their neighbours; the direction
        of motion after each, -1 or 1; and ticks of the crowded reversals, whose jumps overlap.
    """
    # scipy.ndimage is imported here because it takes long to load.
    from scipy.ndimage import gaussian_filter1d

    travel = _without_hum(recording.column("/sensor", "suspension_lvdt"), recording.time)
    velocity = np.gradient(
        gaussian_filter1d(travel, SMOOTHING / recording.period), recording.period
    )
    crossings = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    gap = SEPARATION / recording.period
    # Prepending and appending a full gap lets the first and the last crossing count as isolated.
    behind = np.diff(crossings, prepend=-gap) >= gap
    alone = behind & (np.diff(crossings, append=recording.ticks + gap) >= gap)
    isolated = crossings[alone]
    # A few ticks later the velocity has clearly left zero, so that its sign is certain.
    after = np.minimum(isolated + 5, recording.ticks - 1)
    return isolated, np.sign(velocity[after]), crossings[~alone]


def list_complete_reversals(
    recording: RecordedTest, window: int
) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Return the reversals with a complete window about them, as `reversals` does."""
    turns, directions, crowded = reversals(recording)
    inside = (turns > window) & (turns < recording.ticks - 3 * window)
    turns, directions = turns[inside], directions[inside]
    if len(turns) < MIN_REVERSALS:
        raise RigtwinError(
            f"{recording.path}: the motor reverses {len(turns)} times; "
            f"expected at least {MIN_REVERSALS}"
        )
    return turns, directions, crowded


def average_rises(errors: Array, ticks: NDArray[np.intp], directions: Array, window: int) -> Array:
    """Return the mean rise of the force error after a reversal, in N, shape (2 · window,)."""
    # Before a reversal the error is the steady tracking error; friction causes the rise above it.
    # The last quarter of the window is left out, because the tick of the jump is only known
    # roughly.
    steady = directions * np.array(
        [np.mean(errors[tick - window : tick - window // 4]) for tick in ticks]
    )
    # The sign makes all reversals look alike: the error then rises.
    pairs = zip(ticks, directions, strict=True)
    rises = np.array([way * errors[tick : tick + 2 * window] for tick, way in pairs])
    return np.mean(rises - steady[:, None], axis=0)


def measure_jumps(
    recording: RecordedTest, turns: NDArray[np.intp], directions: Array, window: int
) -> tuple[NDArray[np.intp], float]:
    """Return the tick of the force's jump at each reversal, and the Coulomb force, in N."""
    # Friction = commanded motor force, delayed by the motor's lag, minus the measured force.
    command = MOTOR_CONSTANT * recording.column("/command", "voltage")
    cell = recording.column("/sensor", "load_cell")
    friction = _without_hum(filter_lag(command, MOTOR_LAG, recording.period) - cell, recording.time)
    # The velocity locates a reversal only roughly. The jump is where the difference of the mean
    # force before and after is largest.
    pairs = zip(turns, directions, strict=True)
    jumps = [_jump(friction, tick, way, window) for tick, way in pairs]
    # The median is robust against reversals that were located wrongly.
    coulomb = 0.5 * float(np.median([size for _, size in jumps]))
    if not LEAST_FRICTION < coulomb < MOST_FRICTION:
        jump = f"at its reversals the force jumps by {2 * coulomb:.3g} N"
        raise RigtwinError(
            f"{recording.path}: {jump}; expected dry friction, "
            f"{2 * LEAST_FRICTION:g} to {2 * MOST_FRICTION:g} N"
        )
    return np.array([tick for tick, _ in jumps]), coulomb


def list_directions(
    count: int, ticks: NDArray[np.intp], directions: Array, crowded: NDArray[np.intp]
) -> Array:
    """Return the direction of motion at each tick, which changes at every reversal."""
    way = np.empty(count)
    # Before the first reversal the motion has the opposite direction.
    way[: ticks[0]] = -directions[0]
    for first, last, direction in zip(ticks, [*ticks[1:], count], directions, strict=True):
        way[first:last] = direction
        for number in crowded[(crowded > first) & (crowded < last)]:
            way[number:last] *= -1.0
    return way


def _jump(friction: Array, tick: int, way: float, window: int) -> tuple[int, float]:
    """Return the tick near a reversal where friction rises most towards `way`, and the rise in N.

    Means over half a window come from differences of one cumulative sum.
    """
    near = np.arange(max(tick - window, window), tick + window)
    # The cumulative sum has a leading zero, so that total[b] − total[a] sums the samples a to b −
    # 1.
    total = np.concatenate([[0.0], np.cumsum(friction)])
    half = window // 2
    after = (total[near + half] - total[near]) / half
    before = (total[near] - total[near - half]) / half
    best = int(np.argmax(way * (after - before)))
    return int(near[best]), float(way * (after - before)[best])
