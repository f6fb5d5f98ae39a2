"""Settings of the thesis' friction compensator, identified from the friction spikes of a recording
(§4.5).

A recording made without compensation shows how far the force jumps when the motor reverses, how the
force error rises afterwards, and how early the filtered velocity indicates the reversal. The force
error is split into the part that friction causes through the known force loop and the remainder.
The compensator is then simulated on the recording, with its steps closed through that loop. The
identified settings minimise the force error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers import Compensator, Settings
from controllers.filters import low_pass
from controllers.force import MOTOR_CONSTANT
from controllers.friction import MAINS, MOTOR_LAG, NO_ERRORS, NO_VELOCITIES, REST, step_compensator
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording

SEPARATION = 0.05
"""Minimum time between reversals that are used to measure the jump, in s."""
WINDOW = 0.02
"""Time before and after a reversal over which the friction is averaged, in s."""
SMOOTHING = 0.008
"""Standard deviation of the Gaussian that smooths the travel before reversals are located, in s.
The filter is symmetric in time, so it adds no lag."""
MIN_REVERSALS = 8
"""Minimum number of reversals."""
LEAST_FRICTION, MOST_FRICTION = 0.5, 500.0
"""Range of a plausible Coulomb force, in N. A jump outside is noise or a fault."""
REQUIRED = (
    ("/command", "force"),
    ("/command", "voltage"),
    ("/sensor", "suspension_lvdt"),
    ("/sensor", "load_cell"),
)
# Ranges that the search covers, each in the setting's unit. The upper bound of the integer setting
# spike_samples lies just below 6, because its fraction is cut off.
BOUNDS = {
    "spike_threshold": (1.0, 12.0),
    "spike_gradient": (50.0, 4000.0),
    "spike_samples": (1.0, 5.99),
    "crossing_time": (0.01, 0.15),
    "crossing_extension": (0.0, 0.05),
    "filter_acceleration": (0.002, 0.05),
}


@dataclass(frozen=True)
class Calibration:
    """Identified settings, and the performance of the detector on the recording.

    Attributes
    ----------
    settings
        Identified settings of the controller.
    friction
        Coulomb force of the motor, in N.
    envelope
        Mean force error after a reversal, positive in the new direction, in N; one value per tick
        for twice `WINDOW`.
    reversals
        Number of measured reversals.
    detected
        Number of reversals the compensator detected.
    false
        Number of steps without a reversal.
    delay
        Median time from reversal to detection, in s; NaN without detections.
    """

    settings: Settings
    friction: float
    envelope: Array
    reversals: int
    detected: int
    false: int
    delay: float

    def toml(self) -> str:
        """Return the settings as TOML text, for the option `--config`."""
        names = ("friction_step", *BOUNDS)
        values = [f"{name} = {float(getattr(self.settings, name)):.6g}" for name in names]
        compensator = f'compensator = "{Compensator.TWO_STEP.label}"'
        return "\n".join(["[controller]", compensator, *values]) + "\n"


@kernel
def _detect(settings: Settings, travels: Array, errors: Array, period: float, out: Array) -> None:
    """Write the direction of the compensator's step at each tick, or 0, as if none were applied."""
    state, velocities, last = REST, NO_VELOCITIES, NO_ERRORS
    for tick in range(len(travels)):
        before = state.added
        state, velocities, last = step_compensator(
            settings,
            state,
            velocities,
            last,
            travel=travels[tick],
            error=errors[tick],
            period=period,
        )
        out[tick] = np.sign(state.added - before)


class _Test(NamedTuple):
    """Inputs of the force loop at each tick of a test.

    Attributes
    ----------
    travels
        Measured travel, in m.
    rest
        Force error not due to friction, in N.
    friction
        Friction force, in N.
    period
        Duration of a tick, in s.
    """

    travels: Array
    rest: Array
    friction: Array
    period: float


@kernel
def _close_loop(
    settings: Settings,
    compensated: bool,
    test: _Test,
    errors: Array,
    steps: Array,
) -> float:
    """Simulate the force loop under friction, with or without the compensator.

    The motor is a first-order lag, the controller proportional-integral on the filtered error.

    Parameters
    ----------
    errors, steps
        Outputs, one value per tick: the filtered force error due to friction, in N, and the
        direction of each step.

    Returns
    -------
    float
        Mean square of the force error that friction causes, in N².
    """
    state, velocities, last = REST, NO_VELOCITIES, NO_ERRORS
    motor, integral, filtered, total = 0.0, 0.0, 0.0, 0.0
    period = test.period
    # Exact discretisation of the first-order lag under a held command.
    stays = np.exp(-period / MOTOR_LAG)
    for tick in range(len(test.travels)):
        # Load cell = motor force minus friction: the loop is linear, so the response to friction
        # can be simulated alone and the measured remainder added where the compensator reads it.
        felt = motor - test.friction[tick]
        total += felt**2
        filtered = felt if tick == 0 else low_pass(filtered, felt, settings.filter_force, period)
        errors[tick] = -filtered
        before = state.added
        if compensated:
            state, velocities, last = step_compensator(
                settings,
                state,
                velocities,
                last,
                travel=test.travels[tick],
                error=test.rest[tick] - filtered,
                period=period,
            )
        steps[tick] = np.sign(state.added - before)
        integral -= settings.ki * filtered * period
        command = integral - settings.kp * filtered + state.added
        motor = stays * motor + (1.0 - stays) * command
    return total / len(test.travels)


@kernel
def filter_lag(samples: Array, time_constant: float, period: float) -> Array:
    """Return the samples filtered by the controller's first-order low pass.

    The filter starts at the first sample. The time constant and the period are in s.
    """
    out = np.empty_like(samples)
    out[0] = samples[0]
    for tick in range(1, len(samples)):
        out[tick] = low_pass(out[tick - 1], samples[tick], time_constant, period)
    return out


def detections(
    settings: Settings,
    travels: Array,
    demanded: Array,
    cells: Array,
    period: float,
) -> Array:
    """Return the direction of the compensator's step at each tick, or 0, as if none were applied.

    Parameters
    ----------
    settings
        Settings of the compensator.
    travels
        Measured travel, in m, shape (ticks,).
    demanded
        Demanded force, in N, shape (ticks,).
    cells
        Measured force, in N, shape (ticks,).
    period
        Duration of a tick, in s.
    """
    out = np.empty(len(travels))
    errors = demanded - filter_lag(np.ascontiguousarray(cells), settings.filter_force, period)
    _detect(settings, np.ascontiguousarray(travels), errors, period, out)
    return out


def _without_hum(signal: Array, time: Array) -> Array:
    """Return the signal without its component at mains frequency, fitted by least squares."""
    # Sine and cosine at the nominal frequency: amplitude and phase follow from a linear fit.
    turn = 2 * np.pi * MAINS * time
    waves = np.column_stack([np.sin(turn), np.cos(turn)])
    return signal - waves @ np.linalg.lstsq(waves, signal - signal.mean(), rcond=None)[0]


def reversals(recording: Recording) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
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
        gaussian_filter1d(travel, SMOOTHING / recording.period),
        recording.period,
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


def find_compensator(recording: Recording, settings: Settings, seed: int = 0) -> Calibration:
    """Identify the compensator's settings from a recording made without compensation.

    Parameters
    ----------
    recording
        Recording made without compensation.
    settings
        Settings of the controller that made the recording.
    seed
        Seed of the search.

    Returns
    -------
    Calibration
        Settings with the least force error, and the detector's performance with them.

    Raises
    ------
    RigtwinError
        If the recording was made with compensation, has values that are not finite, has too few
        reversals, or its force does not jump at them.
    """
    _check_recording(recording, settings)
    period = recording.period
    window = round(WINDOW / period)
    turns, directions, crowded = _list_complete_reversals(recording, window)
    ticks, coulomb = _measure_jumps(recording, turns, directions, window)
    cell = recording.column("/sensor", "load_cell")
    errors = recording.column("/command", "force") - filter_lag(cell, settings.filter_force, period)
    envelope = _average_rises(errors, ticks, directions, window)
    friction = coulomb * _directions(recording.ticks, ticks, directions, crowded)
    # A reversal turns friction from -F to +F, so the compensating step is 2 F.
    base = settings._replace(compensator=Compensator.ONE_STEP, friction_step=2 * coulomb)
    travels = recording.column("/sensor", "suspension_lvdt")
    test = _Test(travels, np.zeros(recording.ticks), friction, period)
    # `due` is the error that friction causes through the known loop; the measured error less that
    # part belongs to all other causes, and is assumed to be unchanged by compensation.
    due, steps = np.empty(recording.ticks), np.empty(recording.ticks)
    _close_loop(base, False, test, due, steps)
    test = test._replace(rest=errors - due)

    best = _search_settings(base, test, seed)
    _close_loop(best, True, test, due, steps)
    # The search minimises the force error alone; detections and false steps only describe the
    # result.
    delays, false = _match_steps(steps, ticks, directions, len(envelope), crowded)
    delay = float(np.median(delays)) * period if delays else float("nan")
    return Calibration(
        settings=best,
        friction=coulomb,
        envelope=envelope,
        reversals=len(ticks),
        detected=len(delays),
        false=false,
        delay=delay,
    )


def _list_complete_reversals(
    recording: Recording, window: int
) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Return the reversals with a complete window about them, as `reversals` does."""
    turns, directions, crowded = reversals(recording)
    inside = (turns > window) & (turns < recording.ticks - 3 * window)
    turns, directions = turns[inside], directions[inside]
    if len(turns) < MIN_REVERSALS:
        raise RigtwinError(
            f"{recording.path}: the motor reverses {len(turns)} times; "
            f"expected at least {MIN_REVERSALS}",
        )
    return turns, directions, crowded


def _average_rises(errors: Array, ticks: NDArray[np.intp], directions: Array, window: int) -> Array:
    """Return the mean rise of the force error after a reversal, in N, shape (2 · window,)."""
    # Before a reversal the error is the steady tracking error; friction causes the rise above it.
    # The last quarter of the window is left out, because the tick of the jump is only known
    # roughly.
    steady = directions * np.array(
        [np.mean(errors[tick - window : tick - window // 4]) for tick in ticks],
    )
    # The sign makes all reversals look alike: the error then rises.
    pairs = zip(ticks, directions, strict=True)
    rises = np.array([way * errors[tick : tick + 2 * window] for tick, way in pairs])
    return np.mean(rises - steady[:, None], axis=0)


def _search_settings(base: Settings, test: _Test, seed: int) -> Settings:
    """Return the settings within BOUNDS whose compensator leaves the least force error."""
    # scipy.optimize is imported here because it takes long to load.
    from scipy.optimize import differential_evolution

    due, steps = np.empty(len(test.travels)), np.empty(len(test.travels))

    def set_values(values: Array) -> Settings:
        changed = base._replace(**dict(zip(BOUNDS, values.tolist(), strict=True)))
        return changed._replace(spike_samples=float(int(changed.spike_samples)))

    def mean_square_error(values: Array) -> float:
        return float(_close_loop(set_values(values), True, test, due, steps))

    # The detector's thresholds make the error piecewise constant in places, so the search must not
    # need gradients, and no polishing step follows it.
    optimum = differential_evolution(
        mean_square_error,
        list(BOUNDS.values()),
        popsize=8,
        maxiter=25,
        tol=1e-3,
        polish=False,
        rng=np.random.default_rng(seed),
    )
    return set_values(np.asarray(optimum.x))


def _check_recording(recording: Recording, settings: Settings) -> None:
    """Raise RigtwinError unless the recording was made uncompensated and is finite."""
    if settings.compensator != Compensator.NONE:
        state = f"recorded with compensator {settings.compensator.label!r}; expected 'none'"
        raise RigtwinError(f"{recording.path}: {state}")
    for topic, name in REQUIRED:
        if not np.isfinite(recording.column(topic, name)).all():
            raise RigtwinError(
                f"{recording.path}: {topic}.{name} has values that are not finite; "
                "expected finite numbers at every tick"
            )


def _measure_jumps(
    recording: Recording, turns: NDArray[np.intp], directions: Array, window: int
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


def _directions(
    count: int,
    ticks: NDArray[np.intp],
    directions: Array,
    crowded: NDArray[np.intp],
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


def _match_steps(
    steps: Array,
    turns: NDArray[np.intp],
    directions: Array,
    within: int,
    crowded: NDArray[np.intp],
) -> tuple[list[int], int]:
    """Return the ticks from each detected reversal to its detection, and the number of false steps.

    A step near a crowded reversal counts as neither.
    """
    made = np.flatnonzero(steps)
    used, delays = np.zeros(len(made), bool), []
    for turn, way in zip(turns, directions, strict=True):
        # The reversal's own tick is uncertain by a few ticks, so a slightly early step counts.
        first, last = np.searchsorted(made, [turn - 3, turn + within])
        hits = [number for number in range(first, last) if steps[made[number]] == way]
        if hits:
            used[hits[0]] = True
            delays.append(max(int(made[hits[0]] - turn), 0))
    wrong = made[~used]
    # Both searches find the same place exactly if no crowded reversal lies in between.
    near = np.searchsorted(crowded, wrong - within) != np.searchsorted(crowded, wrong + within)
    return delays, int(np.sum(~near))
