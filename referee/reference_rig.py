"""The referee's rig with its own controller: the plant of `reference_plant` under a set law."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from referee.reference_plant import advance, at_rest, sample
from referee.reference_truth import Array, Truth


class Law(NamedTuple):
    """Settings of the controller.

    Attributes
    ----------
    imposed : bool
        Whether force and motions are imposed. Otherwise suspension and body are simulated.
    start : float
        Initial position of the structure plate, m.
    sprung_mass, stiffness, damping : float
        Simulated body, kg, and suspension, N/m and Ns/m.
    preload : float
        Preload of the suspension, N.
    gravity : float
        Gravity, m/s².
    filter_position, filter_velocity, filter_force : float
        Lags of the three filters, s.
    kff, kp, ki : float
        Gains of the force loop: feedforward, proportional, and integral, 1/s.
    limit : float
        Largest voltage, V.
    """

    imposed: bool = True
    start: float = -0.004
    sprung_mass: float = 25.0
    stiffness: float = 1000.0
    damping: float = 50.0
    preload: float = 200.0
    gravity: float = 9.81
    filter_position: float = 0.01
    filter_velocity: float = 0.01
    filter_force: float = 0.01
    kff: float = 1.0
    kp: float = 0.3
    ki: float = 10.0
    limit: float = 10.0


class LawState(NamedTuple):
    """Memory of the controller between ticks.

    Attributes
    ----------
    sample, travel, speed, force : float
        Travel as measured, m, and filtered travel, m, speed, m/s, and force, N.
    integral : float
        Integral of the force loop, N.
    position, velocity : float
        Simulated body, m and m/s.
    """

    sample: float
    travel: float
    speed: float
    force: float
    integral: float
    position: float
    velocity: float


@numba.njit(cache=True, nogil=True)
def control(
    law: Law, state: LawState, sensed: Array, demand: Array
) -> tuple[LawState, float, float, float]:
    """Return the state after one tick, and the commands: structure, m, force, N, and voltage, V.

    sensed: readings, shape (4,); demand: ground, m, structure, m, and force, N, shape (3,).
    """
    # First-order lags, implicit Euler at 1 ms.
    travel = state.travel + 1e-3 / (law.filter_position + 1e-3) * (sensed[2] - state.travel)
    speed = state.speed + 1e-3 / (law.filter_velocity + 1e-3) * (
        (sensed[2] - state.sample) / 1e-3 - state.speed
    )
    force = state.force + 1e-3 / (law.filter_force + 1e-3) * (sensed[3] - state.force)
    model, velocity = state.position, state.velocity
    if law.imposed:
        demanded, position = demand[2], demand[1]
    else:
        # F = F_0 − k x − b v: the suspension in the model.
        demanded = law.preload - law.stiffness * travel - law.damping * speed
        # Semi-implicit Euler: the velocity first, then the position with the new velocity.
        velocity += (force / law.sprung_mass - law.gravity) * 1e-3
        model += velocity * 1e-3
        position = model
    error = demanded - force
    integral = state.integral + law.ki * error * 1e-3
    voltage = (law.kff * demanded + law.kp * error + integral) / 186.0
    # Anti-windup: the integral stands still while the voltage saturates.
    if abs(voltage) >= law.limit:
        voltage, integral = max(-law.limit, min(law.limit, voltage)), state.integral
    after = LawState(sensed[2], travel, speed, force, integral, model, velocity)
    return after, position, demanded, voltage


@numba.njit(cache=True, nogil=True)
def simulate(
    truth: Truth,
    law: Law,
    demands: Array,
    voltages: Array,
    noise: Array,
    missed: Array,
    commands: Array,
    sensors: Array,
) -> int:
    """Run a test and return the number of completed ticks.

    Parameters
    ----------
    truth, law
        Rig and controller.
    demands : ndarray
        Ground, m, structure, m, and force, N, shape (ticks, 3).
    voltages : ndarray
        Voltages that replace the controller's, V, shape (ticks,) or empty.
    noise : ndarray
        Noise of the sensors, shape (ticks, 4).
    missed : ndarray
        1 for a missed tick, shape (ticks,).
    commands, sensors : ndarray
        Recorded commands and sensors, written in place, shape (ticks, 4).
    """
    body = at_rest(truth, demands[0, 0], law.start, law.preload)
    state = LawState(0.0, 0.0, 0.0, 0.0, 0.0, law.start, 0.0)
    # The commands before the first tick: the rig has stood still under its preload.
    held = np.array([demands[0, 0], law.start, law.preload, law.preload / 186.0])
    for tick in range(len(demands)):
        sample(truth, body, tick, noise[tick], sensors[tick])
        if tick == 0:
            # The filters start settled at the first sample.
            first, load = sensors[0, 2], sensors[0, 3]
            state = LawState(first, first, 0.0, load, 0.0, law.start, 0.0)
        if missed[tick] == 0.0:
            state, position, demanded, voltage = control(law, state, sensors[tick], demands[tick])
            # A replay imposes recorded commands; the controller's own are computed and dropped.
            if len(voltages):
                position, voltage = demands[tick, 1], voltages[tick]
            held[0], held[1], held[2], held[3] = demands[tick, 0], position, demanded, voltage
        for number in range(4):
            commands[tick, number] = held[number]
        # The limits of the rig: 0.15 m of the structure plate, 1500 N of the load cell.
        if len(voltages) == 0 and (abs(sensors[tick, 1]) > 0.15 or abs(sensors[tick, 3]) > 1500.0):
            return tick + 1
        advance(truth, body, held, tick * 1e-3)
    return len(demands)


def run(truth: Truth, law: Law, demands: Array, random: np.random.Generator) -> tuple[Array, Array]:
    """Run a test and return the recorded commands and sensors, each of shape (ticks, 4)."""
    ticks = len(demands)
    noise, missed = draw_noise(truth, ticks, random)
    commands, sensors = np.empty((ticks, 4)), np.empty((ticks, 4))
    completed = simulate(
        truth=truth,
        law=law,
        demands=np.ascontiguousarray(demands),
        voltages=np.empty(0),
        noise=noise,
        missed=missed,
        commands=commands,
        sensors=sensors,
    )
    return commands[:completed], sensors[:completed]


def draw_noise(truth: Truth, ticks: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Draw the sensors' noise, shape (ticks, 4), and the missed ticks, 1 or 0, shape (ticks,)."""
    time = np.arange(ticks) * 1e-3
    noise = np.empty((ticks, 4))
    for number, sensor in enumerate(
        (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
    ):
        # One phase per sensor, for the whole test: the mains is not synchronised with the ticks.
        mains = sensor.mains * np.sin(2 * np.pi * 50.0 * time + random.uniform(0.0, 2.0 * np.pi))
        noise[:, number] = sensor.white * random.standard_normal(ticks) + mains
    missed = (random.random(ticks) < truth.missed).astype(float)
    # The first tick sets the initial state of the controller.
    missed[0] = 0.0
    return noise, missed


def run_quiet(truth: Truth, law: Law, commands: Array) -> Array:
    """Return the sensors without noise under recorded commands; both have shape (ticks, 4)."""
    ticks = len(commands)
    out, sensors = np.empty((ticks, 4)), np.empty((ticks, 4))
    demands, voltages = np.ascontiguousarray(commands[:, :3]), np.ascontiguousarray(commands[:, 3])
    simulate(
        truth=truth,
        law=law,
        demands=demands,
        voltages=voltages,
        noise=np.zeros((ticks, 4)),
        missed=np.zeros(ticks),
        commands=out,
        sensors=sensors,
    )
    return sensors
