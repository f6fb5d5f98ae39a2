"""The referee's rig with its own controller: the plant of `reference_plant` under the law that its
operator set."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from referee.reference_plant import Array, Truth, advance, at_rest, sample


class Law(NamedTuple):
    """The controller as its operator set it."""

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
    """Runs a test. demands: ground m, structure m, force N, shape (ticks, 3); voltages: V, in place
    of the controller's, or empty; noise: of the sensors, shape (ticks, 4); missed: 1 where a tick
    is missed, shape (ticks,); commands, sensors: what is recorded, shape (ticks, 4). Returns
    ticks."""
    body = at_rest(truth, demands[0, 0], law.start, law.preload)
    last = travel = speed = filtered = integral = 0.0
    plate_model, plate_speed = law.start, 0.0
    held = np.array([demands[0, 0], law.start, law.preload, law.preload / 186.0])
    for tick in range(len(demands)):
        time = tick * 1e-3
        sample(truth, body, tick, noise[tick], sensors[tick])
        if missed[tick] == 0.0:
            travelled, measured = sensors[tick, 2], sensors[tick, 3]
            if tick == 0:
                last, travel, filtered = travelled, travelled, measured
            travel += 1e-3 / (law.filter_position + 1e-3) * (travelled - travel)
            speed += 1e-3 / (law.filter_velocity + 1e-3) * ((travelled - last) / 1e-3 - speed)
            filtered += 1e-3 / (law.filter_force + 1e-3) * (measured - filtered)
            last = travelled
            if law.imposed:
                wanted, position = demands[tick, 2], demands[tick, 1]
            else:
                wanted = law.preload - law.stiffness * travel - law.damping * speed
                plate_speed += (filtered / law.sprung_mass - law.gravity) * 1e-3
                plate_model += plate_speed * 1e-3
                position = plate_model
            error = wanted - filtered
            grown = integral + law.ki * error * 1e-3
            voltage = (law.kff * wanted + law.kp * error + grown) / 186.0
            if abs(voltage) >= law.limit:
                voltage = max(-law.limit, min(law.limit, voltage))
            else:
                integral = grown
            if len(voltages):
                position, voltage = demands[tick, 1], voltages[tick]
            held[0], held[1], held[2], held[3] = demands[tick, 0], position, wanted, voltage
        for number in range(4):
            commands[tick, number] = held[number]
        if len(voltages) == 0 and (abs(sensors[tick, 1]) > 0.15 or abs(sensors[tick, 3]) > 1500.0):
            return tick + 1
        advance(truth, body, held, time)
    return len(demands)


def run(truth: Truth, law: Law, demands: Array, random: np.random.Generator) -> tuple[Array, Array]:
    """A whole test: the commands and sensors as recorded, shape (ticks, 4) each."""
    ticks = len(demands)
    noise, absent = draw_noise(truth, ticks, random)
    commands, sensors = np.empty((ticks, 4)), np.empty((ticks, 4))
    done = simulate(
        truth=truth,
        law=law,
        demands=np.ascontiguousarray(demands),
        voltages=np.empty(0),
        noise=noise,
        missed=absent,
        commands=commands,
        sensors=sensors,
    )
    return commands[:done], sensors[:done]


def draw_noise(truth: Truth, ticks: int, random: np.random.Generator) -> tuple[Array, Array]:
    """The sensors' noise, shape (ticks, 4), and 1 where a tick is missed, shape (ticks,)."""
    time = np.arange(ticks) * 1e-3
    noise = np.empty((ticks, 4))
    for number, sensor in enumerate(
        (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
    ):
        mains = sensor.mains * np.sin(2 * np.pi * 50.0 * time + random.uniform(0.0, 2.0 * np.pi))
        noise[:, number] = sensor.white * random.standard_normal(ticks) + mains
    absent = (random.random(ticks) < truth.missed).astype(float)
    absent[0] = 0.0
    return noise, absent


def run_quiet(truth: Truth, law: Law, commands: Array) -> Array:
    """The sensors without noise under given commands, shape (ticks, 4) both."""
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
