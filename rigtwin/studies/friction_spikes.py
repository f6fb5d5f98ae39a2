"""Friction spikes in a recording, and the settings of the thesis' friction compensator found from
them (§4.5).

A recording without compensation holds what a person would read off its plots: how far the force
jumps when the motor reverses, how the force error rises then, and how early the filtered velocity
tells. The force error is split into what friction causes through the known force loop and the rest,
so that the compensator can be tried on the recording with its steps closed through that loop; the
settings are those that leave the least force error.
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

APART = 0.05
"""s; reversals nearer to each other than this are not used to measure the jump."""
BESIDE = 0.02
"""s before and after a reversal over which the friction is averaged."""
SMOOTHING = 0.008
"""s; of the velocity that tells where the motor reverses, forwards and backwards, so without a
lag."""
FEWEST = 8
"""Reversals needed."""
LEAST_FRICTION, MOST_FRICTION = 0.5, 500.0
"""N; a jump outside these is noise or a fault."""
USED = (
    ("/command", "force"),
    ("/command", "voltage"),
    ("/sensor", "suspension_lvdt"),
    ("/sensor", "load_cell"),
)
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
    """Settings found, and what the detector does with them on the recording.

    friction: Coulomb force of the motor, N; envelope: mean force error after a reversal, towards
    the new direction, N, at every tick for BESIDE; delay: median time from reversal to detection,
    s.
    """

    settings: Settings
    friction: float
    envelope: Array
    reversals: int
    detected: int
    false: int
    delay: float

    def toml(self) -> str:
        """The settings as a TOML file's text, for `--config`."""
        names = ("friction_step", *BOUNDS)
        values = [f"{name} = {float(getattr(self.settings, name)):.6g}" for name in names]
        compensator = f'compensator = "{Compensator.TWO_STEP.label}"'
        return "\n".join(["[controller]", compensator, *values]) + "\n"


@kernel
def _detect(settings: Settings, travels: Array, errors: Array, period: float, out: Array) -> None:
    """Direction of the step that would be made at every tick, or 0, were none ever carried out."""
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
    """What the force loop meets, one a tick: travel m, force error not due to friction N, friction
    N.

    period in s.
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
    """The force loop under friction, with the compensator or without.

    Gives back the mean square of the force error that friction leaves, N². errors: the part due to
    friction, as filtered, and steps: direction of each step made; both are written.
    """
    state, velocities, last = REST, NO_VELOCITIES, NO_ERRORS
    motor, integral, filtered, total = 0.0, 0.0, 0.0, 0.0
    period = test.period
    stays = np.exp(-period / MOTOR_LAG)
    for tick in range(len(test.travels)):
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
        told = integral - settings.kp * filtered + state.added
        motor = stays * motor + (1.0 - stays) * told
    return total / len(test.travels)


@kernel
def filter_lag(samples: Array, time_constant: float, period: float) -> Array:
    """Samples through the controller's first-order filter (s), which starts at the first."""
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
    """Direction of the step that the compensator would make at every tick of a test, or 0, were
    none ever carried out. travels, cells: as measured, m and N; demanded: force, N; shape (ticks,)
    each."""
    out = np.empty(len(travels))
    errors = demanded - filter_lag(np.ascontiguousarray(cells), settings.filter_force, period)
    _detect(settings, np.ascontiguousarray(travels), errors, period, out)
    return out


def _without_hum(signal: Array, time: Array) -> Array:
    turn = 2 * np.pi * MAINS * time
    waves = np.column_stack([np.sin(turn), np.cos(turn)])
    return signal - waves @ np.linalg.lstsq(waves, signal - signal.mean(), rcond=None)[0]


def reversals(recording: Recording) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Ticks at which the motor reverses, well apart from each other, and the direction after each;
    ticks of the others, which come too soon after one another to be measured."""
    from scipy.ndimage import gaussian_filter1d  # Late: it takes its time.

    travel = _without_hum(recording.column("/sensor", "suspension_lvdt"), recording.time)
    velocity = np.gradient(
        gaussian_filter1d(travel, SMOOTHING / recording.period),
        recording.period,
    )
    all_of_them = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    gap = APART / recording.period
    behind = np.diff(all_of_them, prepend=-gap) >= gap
    alone = behind & (np.diff(all_of_them, append=recording.ticks + gap) >= gap)
    found = all_of_them[alone]
    return found, np.sign(velocity[np.minimum(found + 5, recording.ticks - 1)]), all_of_them[~alone]


def find_compensator(recording: Recording, settings: Settings, seed: int = 0) -> Calibration:
    """Finds the compensator's settings from a recording made without compensation. settings: those
    that it was made with.

    Raises RigtwinError if it was made with compensation, has values that are no numbers or too few
    reversals, or its force does not jump at them.
    """
    from scipy.optimize import differential_evolution  # Late: it takes its time.

    if settings.compensator != Compensator.NONE:
        told = f"recorded with compensator {settings.compensator.label!r}; expected 'none'"
        raise RigtwinError(f"{recording.path}: {told}")
    period, time = recording.period, recording.time
    for topic, name in USED:
        if not np.isfinite(recording.column(topic, name)).all():
            raise RigtwinError(f"{recording.path}: {topic}.{name} has values that are no numbers")
    turns, directions, others = reversals(recording)
    beside = round(BESIDE / period)
    inside = (turns > beside) & (turns < recording.ticks - 3 * beside)
    turns, directions = turns[inside], directions[inside]
    if len(turns) < FEWEST:
        raise RigtwinError(
            f"{recording.path}: the motor reverses {len(turns)} times; expected {FEWEST} or more",
        )
    told = MOTOR_CONSTANT * recording.column("/command", "voltage")
    cell = recording.column("/sensor", "load_cell")
    friction = _without_hum(filter_lag(told, MOTOR_LAG, period) - cell, time)
    # Where it jumps, within the uncertainty of the velocity: there the difference of what is felt
    # before and after is largest.
    pairs = zip(turns, directions, strict=True)
    jumps = [_jump(friction, tick, way, beside) for tick, way in pairs]
    ticks = np.array([tick for tick, _ in jumps])
    coulomb = 0.5 * float(np.median([size for _, size in jumps]))
    if not LEAST_FRICTION < coulomb < MOST_FRICTION:
        told = f"at its reversals the force jumps by {2 * coulomb:.3g} N"
        raise RigtwinError(f"{recording.path}: {told}, which is no dry friction")
    errors = recording.column("/command", "force") - filter_lag(cell, settings.filter_force, period)
    steady = directions * np.array(
        [np.mean(errors[tick - beside : tick - beside // 4]) for tick in ticks],
    )
    pairs = zip(ticks, directions, strict=True)
    rises = np.array([way * errors[tick : tick + 2 * beside] for tick, way in pairs])
    envelope = np.mean(rises - steady[:, None], axis=0)
    turned = coulomb * _directions(recording.ticks, ticks, directions, others)
    base = settings._replace(compensator=Compensator.ONE_STEP, friction_step=2 * coulomb)
    travels = recording.column("/sensor", "suspension_lvdt")
    test = _Test(travels, np.zeros(recording.ticks), turned, period)
    due, steps = np.empty(recording.ticks), np.empty(recording.ticks)
    _close_loop(base, False, test, due, steps)
    test = test._replace(rest=errors - due)

    def set_values(values: Array) -> Settings:
        found = base._replace(**dict(zip(BOUNDS, values.tolist(), strict=True)))
        return found._replace(spike_samples=float(int(found.spike_samples)))

    def left(values: Array) -> float:
        return float(_close_loop(set_values(values), True, test, due, steps))

    found = differential_evolution(
        left,
        list(BOUNDS.values()),
        popsize=8,
        maxiter=25,
        tol=1e-3,
        polish=False,
        rng=np.random.default_rng(seed),
    )
    best = set_values(np.asarray(found.x))
    _close_loop(best, True, test, due, steps)
    delays, false = _match_steps(steps, ticks, directions, len(envelope), others)
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


def _directions(
    count: int,
    ticks: NDArray[np.intp],
    directions: Array,
    others: NDArray[np.intp],
) -> Array:
    """Direction of the motion at every tick: it changes at the reversals, and at each of the
    others."""
    way = np.empty(count)
    way[: ticks[0]] = -directions[0]
    for first, last, direction in zip(ticks, [*ticks[1:], count], directions, strict=True):
        way[first:last] = direction
        for number in others[(others > first) & (others < last)]:
            way[number:last] *= -1.0
    return way


def _jump(friction: Array, tick: int, way: float, beside: int) -> tuple[int, float]:
    """The tick near a reversal at which friction rises most towards `way`, and by how much."""
    near = np.arange(max(tick - beside, beside), tick + beside)
    total = np.concatenate([[0.0], np.cumsum(friction)])
    half = beside // 2
    after = (total[near + half] - total[near]) / half
    before = (total[near] - total[near - half]) / half
    best = int(np.argmax(way * (after - before)))
    return int(near[best]), float(way * (after - before)[best])


def _match_steps(
    steps: Array,
    turns: NDArray[np.intp],
    directions: Array,
    within: int,
    others: NDArray[np.intp],
) -> tuple[list[int], int]:
    """Ticks from each reversal that is detected to its detection, and how many steps were false. A
    step near one of the `others` is not held against it."""
    made = np.flatnonzero(steps)
    used, delays = np.zeros(len(made), bool), []
    for turn, way in zip(turns, directions, strict=True):
        first, last = np.searchsorted(made, [turn - 3, turn + within])
        hits = [number for number in range(first, last) if steps[made[number]] == way]
        if hits:
            used[hits[0]] = True
            delays.append(max(int(made[hits[0]] - turn), 0))
    wrong = made[~used]
    near = np.searchsorted(others, wrong - within) != np.searchsorted(others, wrong + within)
    return delays, int(np.sum(~near))
