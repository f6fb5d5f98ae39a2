"""Machines whose physics differ from the library's, written from textbooks without the twin's code.

Friction is a bristle (Canudas de Wit et al., A new model for control of systems with friction, IEEE
TAC 40(3), 1995), stepped implicitly, or a tanh of the speed. It may grow with the load and fall as
the machine warms up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from referee.friction_truth import (
    ElasticTruth,
    FrictionTruth,
    carry_rider,
    elastic_force,
    step_friction,
)

Array = NDArray[np.float64]
FINE = 10
"""Integration steps per tick."""
FASTEST, HALVINGS = 50.0, 60
"""Bound of the speed behind a spring, m/s, and the number of its bisections."""


@numba.njit
def _drive_pendulum(
    friction: FrictionTruth,
    elastic: ElasticTruth,
    mass: float,
    arm: float,
    start: float,
    torque: Array,
    sag: float,
    h: float,
    substeps: int,
) -> Array:
    """Return the angle at every tick, rad, under a torque; arm: weight times lever, Nm."""
    x, v, z, rider, speed = start, 0.0, 0.0, start, 0.0
    out = np.zeros(len(torque))
    for tick in range(len(torque)):
        out[tick] = x
        command = torque[tick]
        drive_force = command / (1.0 + sag * abs(command))
        for k in range(substeps):
            # Load of the bearing times the lever: m·g·cos x and the centripetal m·l·ω², in Nm.
            load = arm * math.cos(x) + mass * v * v
            resistance, z = step_friction(friction, z, v, load, (tick * substeps + k) * h, h)
            total = drive_force - resistance - elastic_force(elastic, x) - arm * math.sin(x)
            if elastic.rider > 0.0:
                rider_force, rider, speed = carry_rider(elastic, x, v, rider, speed, h)
                total -= rider_force
            v += h * total / mass
            x += h * v
    return out


def drive_pendulum(
    friction: FrictionTruth,
    elastic: ElasticTruth,
    mass: float,
    arm: float,
    start: float,
    torque: Array,
    sag: float,
    period: float,
) -> Array:
    """Return the angle of a pendulum at every tick under a recorded torque, rad.

    Parameters
    ----------
    friction, elastic
        Friction and elastic torques.
    mass : float
        Moment of inertia, kg m².
    arm : float
        Weight times lever, Nm.
    start : float
        Initial angle, rad.
    torque : ndarray
        Torque at every tick, Nm, shape (ticks,).
    sag : float
        Loss of the drive under load, 1/Nm: torque/(1 + sag |torque|).
    period : float
        Sample period, s.
    """
    # The steps resolve the mass on its bristle: ω h ≤ 1/4.
    size = max(friction.slip * friction.breakaway + friction.load_friction * (arm + mass), 1e-9)
    stiffness = (
        size / friction.bristle
        if friction.tanh_speed == 0.0
        else size / friction.tanh_speed / period
    )
    substeps = max(FINE, math.ceil(4.0 * period * math.sqrt(stiffness / mass)))
    return _drive_pendulum(
        friction, elastic, mass, arm, start, torque, sag, period / substeps, substeps
    )


@numba.njit
def _control_carriage(
    friction: FrictionTruth,
    elastic: ElasticTruth,
    mass: float,
    gains: tuple[float, float, float],
    reference: Array,
    noise: Array,
    sag: float,
    bit: float,
    period: float,
    substeps: int,
) -> tuple[Array, Array]:
    """Return measured position, m, and commanded force, N, of a controlled carriage, per tick.

    gains: force per controller output, K_p and K_v of a cascade of position and velocity control.
    """
    to_force, kp, kv = gains
    x, v, z, rider, speed = reference[0], 0.0, 0.0, reference[0], 0.0
    h = period / substeps
    positions, force = np.zeros(len(reference)), np.zeros(len(reference))
    previous, previous_mean = reference[0], reference[0]
    for tick in range(len(reference)):
        sensed = x + noise[tick]
        if bit > 0.0:
            sensed = round(sensed / bit) * bit
        # The controller differentiates means of two samples.
        mean = 0.5 * (sensed + previous)
        rate = 0.0 if tick == 0 else (mean - previous_mean) / period
        previous, previous_mean = sensed, mean
        # A cascade: kp makes a speed of the position's error, kv a force of the speed's.
        command = to_force * (kp * kv * (reference[tick] - sensed) - kv * rate)
        positions[tick], force[tick] = sensed, command
        drive_force = command / (1.0 + sag * abs(command))
        for k in range(substeps):
            resistance, z = step_friction(friction, z, v, 0.0, (tick * substeps + k) * h, h)
            total = drive_force - resistance - elastic_force(elastic, x)
            if elastic.rider > 0.0:
                rider_force, rider, speed = carry_rider(elastic, x, v, rider, speed, h)
                total -= rider_force
            v += h * total / mass
            x += h * v
    return positions, force


def control_carriage(
    friction: FrictionTruth,
    elastic: ElasticTruth,
    mass: float,
    gains: tuple[float, float, float],
    reference: Array,
    noise: Array,
    sag: float,
    bit: float,
    period: float,
) -> tuple[Array, Array]:
    """Return the results of `_control_carriage` with steps that resolve the mass on its bristle."""
    stiffness = (
        # A tanh adds damping but no stiffness, so FINE steps are enough.
        friction.slip * friction.breakaway / friction.bristle if friction.tanh_speed == 0.0 else 0.0
    )
    substeps = max(FINE, math.ceil(4.0 * period * math.sqrt(stiffness / mass)))
    return _control_carriage(
        friction, elastic, mass, gains, reference, noise, sag, bit, period, substeps
    )


@dataclass(frozen=True)
class FollowerTruth:
    """Positioning actuator.

    Attributes
    ----------
    lag, delay : float
        First-order lag and delay, s.
    speed_limit : float
        Speed that the actuator approaches smoothly, m/s. 0 stands for no limit.
    play : float
        Play, m.
    gain_loss : float
        Share of the gain lost per second, 1/s.
    resonance : tuple of float, optional
        Natural frequency, Hz, and damping ratio of a load on a spring. None for a rigid load.
    lag_growth : float
        Relative growth of the lag with the position error, 1/m.
    """

    lag: float = 0.0
    delay: float = 0.0
    speed_limit: float = 0.0
    play: float = 0.0
    gain_loss: float = 0.0
    resonance: tuple[float, float] | None = None
    lag_growth: float = 0.0


@numba.njit
def _follow_command(
    command: Array,
    lag: float,
    speed_limit: float,
    play: float,
    resonance: tuple[float, float],
    lag_growth: float,
    h: float,
) -> Array:
    """Return the position of the actuator at every integration step, m; h: step, s."""
    position, after_play, end, speed = command[0], command[0], command[0], 0.0
    w = 2.0 * math.pi * resonance[0]
    out = np.zeros(len(command))
    for n in range(len(command)):
        # Play operator: `play` is half the play.
        after_play = min(max(after_play, command[n] - play), command[n] + play)
        error = after_play - position
        fade_speed = lag * (1.0 + lag_growth * abs(error))
        # Exact step of the lag, so any lag is stable.
        rate = error * (1.0 - math.exp(-h / fade_speed)) / h if lag > 0.0 else error / h
        if speed_limit > 0.0:
            # A soft limit, as a valve or motor has it: no sharp corner that a library's rate limit
            # would fit.
            rate = speed_limit * math.tanh(rate / speed_limit)
        position += h * rate
        if w > 0.0:
            speed += h * (w * w * (position - end) - 2.0 * resonance[1] * w * speed)
            end += h * speed
            out[n] = end
        else:
            out[n] = position
    return out


def follow_command(truth: FollowerTruth, command: Array, period: float) -> Array:
    """Return the position of the actuator at every tick, m, with the command held over a tick."""
    h = period / FINE
    held = np.repeat(command, FINE)
    # The gain falls linearly during the test.
    held *= 1.0 - truth.gain_loss * np.arange(len(held)) * h
    # A delay in whole integration steps needs no interpolation of a held command.
    delay_steps = round(truth.delay / h)
    if delay_steps:
        held = np.concatenate([np.full(delay_steps, held[0]), held[:-delay_steps]])
    resonance = truth.resonance or (0.0, 0.0)
    positions = _follow_command(
        held, truth.lag, truth.speed_limit, 0.5 * truth.play, resonance, truth.lag_growth, h
    )
    # A sample is taken before the command of its tick acts.
    return np.concatenate([[held[0]], positions[FINE - 1 :: FINE][:-1]])
