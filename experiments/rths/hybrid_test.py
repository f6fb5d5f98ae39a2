"""One hybrid test of the benchmark.

The building is simulated; its first column is physical, and the actuator moves it. At every tick
the sensors are read, the compensator computes the command, and the building advances with the
force of the tick before.

The converters have 18 bits over ±3.8 V. Only the command saturates at that range. A load cell that
saturated at 3.8 V, 4165 N, would not reproduce the published figures of case 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.adaptive_law import AdaptiveLaw, adaptive_memory, adaptive_model, step_adaptive
from controllers.compiled import compilable
from controllers.linear_law import LinearLaw, pass_through, step_linear
from experiments.rths.actuator import UNITS, ActuatorPlant, sampled
from experiments.rths.building import (
    PERIOD,
    BuildingCase,
    Specimen,
    move,
    numerical_part,
    whole_building,
)
from experiments.rths.criteria import Criteria, judge
from experiments.rths.noise import NONE, Noise, draw_noise
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

VOLTS, BITS = 3.8, 18
"""Range, V, and resolution of the converters."""
STEP = 2.0 * VOLTS / 2**BITS
"""Quantisation step of a converter, V."""
METRES, NEWTONS = 7.89e-3, 1096.0
"""Position, m, and force, N, that one volt stands for."""
MOST_FORCE, MOST_MOTION, MOST_SPEED = 8900.0, 7e-3, 0.3
"""Limits of the actuator: force, N, displacement, m, and speed, m/s."""
DIVERGED = 1.0
"""Displacement beyond which the loop counts as diverged and the test ends, m."""
Law = LinearLaw | AdaptiveLaw
"""Compensator: a linear law of constant coefficients, or an adaptive one."""


@dataclass(frozen=True)
class HybridTest:
    """Result of one hybrid test.

    Attributes
    ----------
    criteria : Criteria
        J1 to J9; all infinite if the loop diverged.
    force, motion, speed : float
        Largest force, N, displacement, m, and speed, m/s, of the actuator.
    stable : bool
        Whether the loop stayed bounded.
    desired, measured : ndarray
        Desired and measured displacement of the first floor, m, shape (n,).
    command : ndarray
        Command of the actuator, m, shape (n,).
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
        """Whether the test was stable and stayed within the limits of the actuator."""
        small = self.force <= MOST_FORCE and self.motion <= MOST_MOTION
        return self.stable and small and self.speed <= MOST_SPEED


def run_test(
    case: BuildingCase,
    ground: Array,
    law: Law,
    plant: ActuatorPlant | None = None,
    noise: Noise = NONE,
    seed: int = 1,
) -> HybridTest:
    """Run one hybrid test.

    Parameters
    ----------
    case : BuildingCase
        Building to simulate.
    ground : ndarray
        Ground acceleration at every tick, m/s², shape (n,); see `ground_motion`.
    law : LinearLaw or AdaptiveLaw
        Delay compensator.
    plant : Plant, optional
        True actuator and specimen. Defaults to the nominal ones.
    noise : Noise
        Noise of the converters. Defaults to none.
    seed : int
        Seed of the noise. Defaults to 1.

    Returns
    -------
    HybridTest
        Criteria, extremes and signals of the test.

    Raises
    ------
    RigtwinError
        If the ground motion is shorter than one second.
    """
    if len(ground) < round(1.0 / PERIOD):
        raise RigtwinError(
            f"ground motion of {len(ground)} ticks: expected at least {round(1.0 / PERIOD)}, 1 s"
        )
    signals, last = _simulate(case, ground, law, plant or ActuatorPlant(), noise, seed)
    desired, measured = signals[:3].T[:last], signals[3][:last]
    reference = move(whole_building(case), ground)[:last]
    # Criteria of a truncated signal would flatter a loop that diverged.
    stable = last == len(ground)
    return HybridTest(
        judge(desired, measured, reference) if stable else Criteria(*[np.inf] * 9),
        # Force and motion of the whole record, zeros behind a divergence included; the speed
        # needs the part that was simulated.
        float(np.max(np.abs(signals[5]))),
        float(np.max(np.abs(signals[4]))),
        float(np.max(np.abs(np.diff(signals[4][:last])))) / PERIOD,
        stable,
        desired[:, 0],
        measured,
        signals[6][:last],
    )


def _simulate(
    case: BuildingCase, ground: Array, law: Law, plant: ActuatorPlant, noise: Noise, seed: int
) -> tuple[Array, int]:
    """Return the signals of a test, shape (7, n), see `_loop`, and its length in ticks."""
    # The simulated part knows the nominal specimen alone; the true one may differ.
    building = numerical_part(case, Specimen())
    linear, adaptive = _split_law(law)
    a, b = sampled(plant)
    signals = np.zeros((7, len(ground)))
    ticks = _loop(
        building.a,
        building.ground,
        building.force,
        a,
        b,
        # The actuator's states are scaled; position and force are scaled back by these.
        1.0 / UNITS,
        ground,
        draw_noise(noise, len(ground), seed),
        linear,
        adaptive,
        adaptive_memory(adaptive),
        isinstance(law, LinearLaw),
        signals,
    )
    return signals, ticks


def ideal_test(case: BuildingCase, ground: Array, specimen: Specimen | None = None) -> Criteria:
    """Return the criteria of a test with a perfect actuator.

    Two errors remain: the force acts one tick late, and the specimen may differ from the nominal
    one.
    """
    building, specimen = numerical_part(case, Specimen()), specimen or Specimen()
    desired = _ideal_loop(
        building.a,
        building.ground,
        building.force,
        np.array([specimen.stiffness, specimen.damping, specimen.mass]),
        ground,
    )
    return judge(desired, desired[:, 0], move(whole_building(case), ground))


@kernel
def _ideal_loop(  # type: ignore[no-untyped-def]
    building, by_ground, by_force, specimen, ground
):
    state, force = np.zeros(6), 0.0
    desired = np.empty((len(ground), 3))
    for tick in range(len(ground)):
        desired[tick] = state[:3]
        next_state = building @ state + by_ground * ground[tick] + by_force * force
        # The actuator's acceleration is that of the floor over the next tick.
        acceleration = (next_state[3] - state[3]) / PERIOD
        force = specimen[0] * state[0] + specimen[1] * state[3] + specimen[2] * acceleration
        state = next_state
    return desired


def _split_law(law: Law) -> tuple[LinearLaw, AdaptiveLaw]:
    """Return a linear and an adaptive law, of which one is the law and one a stand-in.

    Compiled code needs a fixed type for both arguments. The stand-in is never stepped.
    """
    if isinstance(law, AdaptiveLaw):
        return pass_through(), law
    return law, adaptive_model([1.0, 0.0], PERIOD)


@compilable
def _rounded(volts: float) -> float:
    """Return a voltage rounded to the nearest step of a converter, V."""
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
    """Run the closed loop and return the number of ticks until its end or its divergence.

    Fills `signals`, shape (7, ticks), with the displacements of the three floors, the measured and
    the true position of the specimen, its true force, and the command.
    """
    state, force = np.zeros(6), 0.0
    actuator, next_actuator = np.zeros(5), np.zeros(5)
    # Two states each: the new one must not overwrite what the remaining rows still read.
    next_state = np.zeros(6)
    memory, adaptive_state = np.zeros(len(linear.a)), start.copy()
    for tick in range(len(ground)):
        position = actuator[0] * units[0]
        true_force = actuator[2] * units[2]
        # Noise enters before the converter rounds, as it does on the real hardware.
        measured = _rounded(position / METRES + noise[0, tick]) * METRES
        measured_force = _rounded(true_force / NEWTONS + noise[1, tick]) * NEWTONS
        if is_linear:
            wanted = step_linear(linear, memory, state[0], measured)
        else:
            wanted = step_adaptive(adaptive, adaptive_state, state[0], measured)
        command = _rounded(min(max(wanted / METRES, -VOLTS), VOLTS)) * METRES
        for floor in range(3):
            signals[floor, tick] = state[floor]
        signals[3, tick] = measured
        signals[4, tick] = position
        signals[5, tick] = true_force
        signals[6, tick] = command
        # Written so that NaN ends the loop as well.
        if not abs(state[0]) < DIVERGED:
            return tick
        # Written out: a matrix product of this size would allocate an array at every tick.
        for row in range(6):
            total = by_ground[row] * ground[tick] + by_force[row] * force
            for column in range(6):
                total += building[row, column] * state[column]
            next_state[row] = total
        for row in range(5):
            total = b[row] * command
            for column in range(5):
                total += a[row, column] * actuator[column]
            next_actuator[row] = total
        state[:] = next_state
        actuator[:] = next_actuator
        # The force measured now acts on the building in the next tick, as on the real computer.
        force = measured_force
    return len(ground)
