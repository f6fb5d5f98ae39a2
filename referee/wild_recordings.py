"""Recordings of the wild referee's machines."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from referee.benches import wander
from referee.friction_truth import ElasticTruth, FrictionTruth
from referee.imposed_truth import imposed_force
from referee.sensor_truth import SensorTruth, read_sensor
from referee.wild_cases import GUIDES, ROUND, WildCase
from referee.wild_truth import (
    FINE,
    Array,
    FollowerTruth,
    control_carriage,
    drive_pendulum,
    follow_command,
)

GAINS = (35.15065, 160.18, 243.45)
"""Gains of the carriage's controller: force per output, K_p and K_v."""


@dataclass(frozen=True)
class WildData:
    """One test of a machine.

    Attributes
    ----------
    columns : dict
        Topic → field → values, shape (ticks,).
    period : float
        Sample period, s.
    magnitudes : dict
        True values, by kind@component, of the parameters that have one.
    """

    columns: dict[str, dict[str, Array]]
    period: float
    magnitudes: dict[str, float]


def record_wild(case: WildCase, again: int = 0) -> WildData:
    """Record a test of a case; again: number of the repetition on the same machine."""
    # Separate streams: a repetition has another excitation and noise but the same machine.
    machine_random = np.random.default_rng([case.seed, case.number, 11])
    test_random = np.random.default_rng([case.seed, case.number, 13, again])
    return RECORD[case.machine](case, machine_random, test_random)


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _draw_friction(
    parts: tuple[str, ...], random: np.random.Generator, slip: float, viscous: float, speed: float
) -> FrictionTruth:
    """Draw a friction of about `slip` N and `viscous` Ns/m, for speeds up to `speed` m/s."""
    # Every number is drawn whether it is used or not, so parts do not shift the random stream.
    size = slip * _spread(random, 0.4, 2.0)
    damping = viscous * _spread(random, 0.4, 2.0)
    lugre, warms = "lugre" in parts, "warming" in parts
    breakaway, fade_speed = 1.0 + random.uniform(0.2, 0.8), speed * _spread(random, 0.02, 0.1)
    bristle, tanh_speed = _spread(random, 2e-4, 2e-3) * speed, speed * _spread(random, 0.02, 0.1)
    load_friction, warming_loss = _spread(random, 0.01, 0.04), random.uniform(0.2, 0.45)
    warming_time, wear_rate = random.uniform(2.0, 8.0), random.uniform(0.02, 0.05)
    return FrictionTruth(
        slip=size if {"dry", "lugre", "tanh"} & set(parts) else 0.0,
        breakaway=breakaway if lugre else 1.0,
        fade_speed=fade_speed,
        bristle=bristle if lugre else (2e-5 if "frame" in parts else 2e-6) * speed,
        tanh_speed=tanh_speed if "tanh" in parts else 0.0,
        load_friction=load_friction if "load" in parts else 0.0,
        viscous=damping if {"viscous", "wearing"} & set(parts) else 0.0,
        warming_loss=warming_loss if warms else 0.0,
        warming_time=warming_time,
        wear_rate=wear_rate if "wearing" in parts else 0.0,
    )


def _true_sizes(case: WildCase, friction: FrictionTruth) -> dict[str, float]:
    """Return the true magnitudes of parts that have the library's form, for comparing intervals."""
    guide, sizes = GUIDES[case.machine], {}
    if "dry" in case.parts and not friction.warming_loss:
        sizes[f"coulomb@{guide}"] = friction.slip
    if (
        "viscous" in case.parts
        and not friction.warming_loss
        and not friction.wear_rate
        and not friction.tanh_speed
    ):
        sizes[f"viscous@{guide}"] = friction.viscous
    return sizes


def _record_damper(
    case: WildCase, machine_random: np.random.Generator, test_random: np.random.Generator
) -> WildData:
    """Record a damper that is moved as prescribed."""
    period, seconds, parts = float(machine_random.choice([1e-3, 2e-3])), 12.0, case.parts
    friction = _draw_friction(parts, machine_random, 100.0, 900.0, 0.15)
    elastic = ElasticTruth(
        rate=_spread(machine_random, 500.0, 3000.0) if "hardening" in parts else 0.0,
        cubic=_spread(machine_random, 5e5, 5e6) if "hardening" in parts else 0.0,
        rider=_spread(machine_random, 1.0, 4.0) if "rider" in parts else 0.0,
        frequency=_spread(machine_random, 4.0, 12.0),
        ratio=_spread(machine_random, 0.03, 0.2),
        frame=_spread(machine_random, 2e4, 1e5) if "frame" in parts else 0.0,
    )
    reach = float(test_random.uniform(0.02, 0.04))
    motion = wander(test_random, seconds, period / FINE, reach, 0.1, 3.0)
    force = imposed_force(friction, elastic, motion, period)
    size = float(np.std(force))
    cell = SensorTruth(
        noise=0.01 * size,
        coloured=_spread(machine_random, 0.02, 0.06) * size if "coloured" in parts else 0.0,
        bit=10.0 * size / 4096.0 * _spread(machine_random, 1.0, 8.0) if "steps" in parts else 0.0,
        delay=_spread(machine_random, 0.004, 0.02) if "late" in parts else 0.0,
    )
    place = SensorTruth(noise=5e-6, bit=0.2 / 4096.0 if "steps" in parts else 1e-6)
    columns = {
        "displacement": read_sensor(test_random, motion[::FINE], place, period),
        "force": read_sensor(test_random, force, cell, period),
    }
    return WildData({"/sensor": columns}, period, _true_sizes(case, friction))


def _record_actuator(
    case: WildCase, machine_random: np.random.Generator, test_random: np.random.Generator
) -> WildData:
    """Record a positioning actuator."""
    period, parts = float(machine_random.choice([1e-3, 2e-3])), case.parts
    lag = _spread(machine_random, 0.01, 0.05)
    truth = FollowerTruth(
        lag=0.3 * lag if "sprung load" in parts else lag,
        delay=_spread(machine_random, 0.006, 0.03) if "late" in parts else 0.0,
        speed_limit=_spread(machine_random, 0.08, 0.2) if "soft limit" in parts else 0.0,
        play=_spread(machine_random, 5e-4, 3e-3) if "loose" in parts else 0.0,
        gain_loss=_spread(machine_random, 0.005, 0.02) if "fading" in parts else 0.0,
        resonance=(_spread(machine_random, 5.0, 15.0), float(machine_random.uniform(0.1, 0.5)))
        if "sprung load" in parts
        else None,
        lag_growth=_spread(machine_random, 50.0, 300.0) if "curved lag" in parts else 0.0,
    )
    command = wander(test_random, 12.0, period, float(test_random.uniform(0.02, 0.04)), 0.1, 8.0)
    positions = follow_command(truth, command, period)
    sensor = SensorTruth(
        noise=2e-5,
        coloured=_spread(machine_random, 1e-4, 5e-4) if "coloured" in parts else 0.0,
        bit=0.2 / 4096.0 if "steps" in parts else 1e-6,
    )
    columns = (
        {"position": command},
        {"position": read_sensor(test_random, positions, sensor, period)},
    )
    plain = set(parts) <= {"lagging", "steps"}
    return WildData(
        {"/command": columns[0], "/sensor": columns[1]},
        period,
        {"lag@actuator": truth.lag} if plain else {},
    )


def _record_carriage(
    case: WildCase, machine_random: np.random.Generator, test_random: np.random.Generator
) -> WildData:
    """Record a carriage under position control."""
    period, parts = 1e-3, case.parts
    friction = _draw_friction((*parts, "viscous"), machine_random, 20.0, 203.5, 0.15)._replace(
        viscous=203.5
    )
    elastic = ElasticTruth(
        ripple=_spread(machine_random, 2.0, 8.0) if "ripple" in parts else 0.0,
        pitch=_spread(machine_random, 0.008, 0.03),
        phase=float(machine_random.uniform(-3.0, 3.0)),
        rider=_spread(machine_random, 8.0, 25.0) if "rider" in parts else 0.0,
        frequency=_spread(machine_random, 8.0, 25.0),
        ratio=_spread(machine_random, 0.03, 0.15),
    )
    time = np.arange(10000) * period
    slow_rate, fast_rate = test_random.uniform(0.5, 0.8), test_random.uniform(2.5, 4.0)
    reference = 0.11 - 0.11 * np.cos(slow_rate * time) + 0.012 * np.sin(fast_rate * time)
    sensor = SensorTruth(noise=2e-7)
    noise = sensor.noise * test_random.standard_normal(len(time))
    sag = _spread(machine_random, 5e-4, 3e-3) if "sag" in parts else 0.0
    bit = 2e-6 if "steps" in parts else 0.0
    positions, force = control_carriage(
        friction, elastic, 95.1, GAINS, reference, noise, sag, bit, period
    )
    columns = {
        "/command": {"reference": reference, "pulse_voltage": np.zeros(len(time)), "force": force},
        "/sensor": {"position": positions},
    }
    return WildData(columns, period, _true_sizes(case, friction))


def _record_arm(
    case: WildCase, machine_random: np.random.Generator, test_random: np.random.Generator
) -> WildData:
    """Record a swinging arm, driven or free."""
    period, parts = 5e-3, case.parts
    friction = _draw_friction(parts, machine_random, 0.02, 0.008, 4.0)
    elastic = ElasticTruth(
        rate=_spread(machine_random, 0.05, 0.3) if "hardening" in parts else 0.0,
        cubic=_spread(machine_random, 0.1, 0.6) if "hardening" in parts else 0.0,
        ripple=_spread(machine_random, 0.02, 0.08) if "ripple" in parts else 0.0,
        pitch=2.0 * math.pi / float(machine_random.integers(6, 16)),
        phase=float(machine_random.uniform(-3.0, 3.0)),
    )
    ticks = 1600
    # Every round draws one arm; in every second round it swings freely.
    free = not ({"sag", "ripple"} & set(parts)) and case.number // len(ROUND) % 2 == 0
    torque, start = np.zeros(ticks), float(test_random.uniform(0.8, 1.5))
    if not free:
        torque, start = 0.4 * wander(test_random, ticks * period, period, 1.0, 0.2, 2.0), 0.0
    sag = _spread(machine_random, 0.3, 1.0) if "sag" in parts else 0.0
    inertia, arm = 0.5 * 0.15**2 + 0.002, 0.5 * 0.15 * 9.80665
    angle = drive_pendulum(friction, elastic, inertia, arm, start, torque, sag, period)
    sensor = SensorTruth(
        noise=1e-4,
        bit=2.0 * math.pi / 4096.0 if "steps" in parts else 2.0 * math.pi / 65536.0,
        eccentric=_spread(machine_random, 0.01, 0.03) / (2.0 * math.pi)
        if "eccentric" in parts
        else 0.0,
        pitch=2.0 * math.pi,
    )
    columns = {
        "/command": {"torque": torque},
        "/sensor": {"position": read_sensor(test_random, angle, sensor, period)},
    }
    return WildData(columns, period, _true_sizes(case, friction))


RECORD: Mapping[str, Callable[[WildCase, np.random.Generator, np.random.Generator], WildData]] = {
    "damper": _record_damper,
    "actuator": _record_actuator,
    "carriage": _record_carriage,
    "arm": _record_arm,
}
