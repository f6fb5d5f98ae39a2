"""One hybrid test of the benchmark: the building is computed, its first column is real, and the
actuator moves it.

At a tick: the sensors are read, the compensator gives the command, the building goes on with the
force of the tick before. Converters have the steps of 18 bit over ±3.8 V. Only the command is
limited to that range: with a load cell that ends at 3.8 V, 4165 N, the published figures of case 3
do not come out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.adaptive_law import AdaptiveLaw, adaptive_memory, adaptive_model, step_adaptive
from controllers.compiled import compilable
from controllers.linear_law import LinearLaw, pass_through, step_linear
from experiments.rths.actuator import UNITS, Plant, sampled
from experiments.rths.building import PERIOD, Case, Specimen, move, numerical_part, whole_building
from experiments.rths.criteria import Criteria, judge
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

VOLTS, BITS = 3.8, 18
STEP = 2.0 * VOLTS / 2**BITS
METRES, NEWTONS = 7.89e-3, 1096.0
"""A volt."""
HELD = 2e-4
"""s, that a value of the noise is held."""
MOST_FORCE, MOST_MOTION, MOST_SPEED = 8900.0, 7e-3, 0.3
"""N, m, m/s: the actuator's limits."""
DIVERGED = 1.0
"""m: beyond this a loop is not followed any further."""
Law = LinearLaw | AdaptiveLaw


@dataclass(frozen=True)
class Noise:
    """rms, V, of the position's and the force's converter."""

    position: float
    force: float


BENCHMARK = Noise(2e-3, 2e-3)
"""As the benchmark's problem statement has it."""
NONE = Noise(0.0, 0.0)


@dataclass(frozen=True)
class HybridTest:
    """What one test gave.

    criteria: J1 to J9; force N, motion m, speed m/s: the largest; stable: whether the loop stayed
    bounded; desired, measured: of the first floor, m; command: m.
    """

    criteria: Criteria
    force: float
    motion: float
    speed: float
    stable: bool
    desired: Array
    measured: Array
    command: Array

    @property
    def within(self) -> bool:
        """Whether the actuator's limits were kept."""
        kept = self.force <= MOST_FORCE and self.motion <= MOST_MOTION and self.speed <= MOST_SPEED
        return self.stable and kept


def run_test(
    case: Case,
    ground: Array,
    law: Law,
    plant: Plant | None = None,
    noise: Noise = NONE,
    seed: int = 1,
) -> HybridTest:
    """Runs one test.

    Parameters
    ----------
    case
        The building.
    ground
        Acceleration at every tick, m/s², see `ground_motion`.
    law
        The compensator.
    plant
        The actuator and the specimen as they are; nominal by default.
    noise
        Of the converters.
    seed
        Of the noise.

    Raises
    ------
    RigtwinError
        For a ground that is too short to be judged.
    """
    if len(ground) < round(1.0 / PERIOD):
        raise RigtwinError(f"a ground of {len(ground)} ticks: expected one second at least")
    nominal, plant = Specimen(), plant or Plant()
    building = numerical_part(case, nominal)
    linear, adaptive = _both(law)
    a, b = sampled(plant)
    signals = np.zeros((7, len(ground)))
    last = _loop(
        building.a,
        building.ground,
        building.force,
        a,
        b,
        1.0 / UNITS,
        ground,
        _draw(noise, len(ground), seed),
        linear,
        adaptive,
        adaptive_memory(adaptive),
        isinstance(law, LinearLaw),
        signals,
    )
    desired, measured = signals[:3].T[:last], signals[3][:last]
    reference = move(whole_building(case), ground)[:last]
    stable = last == len(ground)
    return HybridTest(
        judge(desired, measured, reference) if stable else Criteria(*[np.inf] * 9),
        float(np.max(np.abs(signals[5]))),
        float(np.max(np.abs(signals[4]))),
        float(np.max(np.abs(np.diff(signals[4][:last])))) / PERIOD,
        stable,
        desired[:, 0],
        measured,
        signals[6][:last],
    )


def ideal_test(case: Case, ground: Array, piece: Specimen | None = None) -> Criteria:
    """The criteria of a test whose actuator follows exactly; what is left is that the force comes a
    tick late, and that the specimen is not the nominal one."""
    building, piece = numerical_part(case, Specimen()), piece or Specimen()
    desired = _ideal_loop(
        building.a,
        building.ground,
        building.force,
        np.array([piece.stiffness, piece.damping, piece.mass]),
        ground,
    )
    return judge(desired, desired[:, 0], move(whole_building(case), ground))


@kernel
def _ideal_loop(  # type: ignore[no-untyped-def]
    building, by_ground, by_force, piece, ground
):
    state, force = np.zeros(6), 0.0
    desired = np.empty((len(ground), 3))
    for tick in range(len(ground)):
        desired[tick] = state[:3]
        after = building @ state + by_ground * ground[tick] + by_force * force
        # The actuator's acceleration is that of the floor over the next tick.
        pushed = (after[3] - state[3]) / PERIOD
        force = piece[0] * state[0] + piece[1] * state[3] + piece[2] * pushed
        state = after
    return desired


def _both(law: Law) -> tuple[LinearLaw, AdaptiveLaw]:
    """Compiled code takes one of each; the other is not stepped."""
    if isinstance(law, AdaptiveLaw):
        return pass_through(), law
    return law, adaptive_model([1.0, 0.0], PERIOD)


def _draw(noise: Noise, ticks: int, seed: int) -> Array:
    """V, shape (2, ticks), held over HELD."""
    random = np.random.default_rng([seed, 3])
    place = (np.arange(ticks) * PERIOD / HELD).astype(int)
    drawn = random.standard_normal((2, int(place[-1]) + 1))
    return drawn[:, place] * np.array([[noise.position], [noise.force]])


@compilable
def _rounded(volts: float) -> float:
    """To the nearest step of a converter, V."""
    return round(volts / STEP) * STEP


@kernel
def _loop(  # type: ignore[no-untyped-def]
    building,
    by_ground,
    by_force,
    a,
    b,
    units,
    ground,
    noise,
    linear,
    adaptive,
    start,
    is_linear,
    signals,
) -> int:
    """Fills signals: three floors, position measured, true position, true force, command. Returns
    the ticks until the end, or until it diverged."""
    state, force = np.zeros(6), 0.0
    real, after_real = np.zeros(5), np.zeros(5)
    after = np.zeros(6)
    memory, adapting = np.zeros(len(linear.a)), start.copy()
    for tick in range(len(ground)):
        position = real[0] * units[0]
        pushed = real[2] * units[2]
        read = _rounded(position / METRES + noise[0, tick]) * METRES
        felt = _rounded(pushed / NEWTONS + noise[1, tick]) * NEWTONS
        if is_linear:
            wanted = step_linear(linear, memory, state[0], read)
        else:
            wanted = step_adaptive(adaptive, adapting, state[0], read)
        command = _rounded(min(max(wanted / METRES, -VOLTS), VOLTS)) * METRES
        for floor in range(3):
            signals[floor, tick] = state[floor]
        signals[3, tick] = read
        signals[4, tick] = position
        signals[5, tick] = pushed
        signals[6, tick] = command
        if not abs(state[0]) < DIVERGED:
            return tick
        for row in range(6):
            total = by_ground[row] * ground[tick] + by_force[row] * force
            for column in range(6):
                total += building[row, column] * state[column]
            after[row] = total
        for row in range(5):
            total = b[row] * command
            for column in range(5):
                total += a[row, column] * real[column]
            after_real[row] = total
        state[:] = after
        real[:] = after_real
        force = felt
    return len(ground)
