"""Machines whose physics differ from the library's, written from textbooks without the twin's code.

Friction is a bristle (Canudas de Wit et al., A new model for control of systems with friction, IEEE
TAC 40(3), 1995), stepped implicitly, or a tanh of the speed. It may grow with the load and fall as
the machine warms up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE = 10
"""Integration steps per tick."""
FASTEST, HALVINGS = 50.0, 60
"""Bound of the speed behind a spring, m/s, and the number of its bisections."""


class FrictionTruth(NamedTuple):
    """Friction, in N, m and s, or Nm, rad and s.

    Attributes
    ----------
    slip, breakaway : float
        Kinetic friction, N, and the ratio of breakaway to kinetic friction.
    fade_speed : float
        Speed at which the friction above `slip` fades, m/s.
    bristle : float
        Deflection at which the bristle slips, m.
    tanh_speed : float
        Speed over which a tanh changes its sign, m/s. 0 selects the bristle.
    load_friction : float
        Friction per load.
    viscous : float
        Viscous friction, Ns/m.
    warming_loss, warming_time : float
        Share of the friction lost by warming up, and its time constant, s.
    wear_rate : float
        Share of the viscous friction lost per second, 1/s.
    """

    slip: float = 0.0
    breakaway: float = 1.0
    fade_speed: float = 0.01
    bristle: float = 1e-6
    tanh_speed: float = 0.0
    load_friction: float = 0.0
    viscous: float = 0.0
    warming_loss: float = 0.0
    warming_time: float = 1.0
    wear_rate: float = 0.0


class ElasticTruth(NamedTuple):
    """Elastic forces and a second mass.

    Attributes
    ----------
    rate, cubic : float
        Linear stiffness, N/m, and cubic stiffness, N/m³, about 0.
    ripple, pitch, phase : float
        Periodic force: amplitude, N, pitch, m, and phase, rad.
    rider, frequency, ratio : float
        Second mass, kg, on a spring: its natural frequency, Hz, and damping ratio.
    frame : float
        Stiffness of the frame, N/m. 0 stands for a rigid one.
    """

    rate: float = 0.0
    cubic: float = 0.0
    ripple: float = 0.0
    pitch: float = 0.01
    phase: float = 0.0
    rider: float = 0.0
    frequency: float = 10.0
    ratio: float = 0.05
    frame: float = 0.0


@dataclass(frozen=True)
class SensorTruth:
    """Sensor and logger; units are those of the signal.

    Attributes
    ----------
    noise : float
        White noise, rms.
    coloured, corner : float
        Low-frequency noise, rms, and its corner frequency, Hz.
    bit : float
        Resolution.
    eccentric, pitch : float
        Amplitude of an encoder's periodic error as a share of its pitch, and the pitch.
    delay : float
        Delay of the channel, s.
    """

    noise: float = 0.0
    coloured: float = 0.0
    corner: float = 2.0
    bit: float = 0.0
    eccentric: float = 0.0
    pitch: float = 0.1
    delay: float = 0.0


@numba.njit
def step_friction(
    friction: FrictionTruth, bristle: float, speed: float, load: float, time: float, step: float
) -> tuple[float, float]:
    """Return the friction, N, and the deflection of the bristle after a step, m.

    F(v) = F_c + (F_s − F_c) exp(−(v/v_s)²); ż = v − |v| z/z_0; friction = F z/z_0.
    """
    warm = 1.0 - friction.warming_loss * (1.0 - math.exp(-time / friction.warming_time))
    fade = math.exp(-((speed / friction.fade_speed) ** 2))
    size = warm * (
        friction.slip * (1.0 + (friction.breakaway - 1.0) * fade)
        + friction.load_friction * abs(load)
    )
    # Wear ends at no friction, or a long test would have a negative one.
    viscous = warm * friction.viscous * max(1.0 - friction.wear_rate * time, 0.0) * speed
    if friction.tanh_speed > 0.0:
        # A tanh has no true stiction: the joint creeps under a constant force, as in many
        # simulators.
        return size * math.tanh(speed / friction.tanh_speed) + viscous, bristle
    # Implicit Euler: the bristle's time constant is much shorter than a step at high speed.
    bristle = (bristle + speed * step) / (1.0 + abs(speed) * step / friction.bristle)
    return size * bristle / friction.bristle + viscous, bristle


@numba.njit
def elastic_force(elastic: ElasticTruth, position: float) -> float:
    """Return the force that depends on the position alone, N."""
    wave = elastic.ripple * math.sin(2.0 * math.pi * position / elastic.pitch + elastic.phase)
    return elastic.rate * position + elastic.cubic * position**3 + wave


@numba.njit
def carry_rider(
    elastic: ElasticTruth, x: float, v: float, rider: float, speed: float, h: float
) -> tuple[float, float, float]:
    """Return the force on the second mass, N, and its position and speed after a step, m, m/s.

    x, v: position, m, and speed, m/s, of the mass that carries it; rider, speed: its own; h: s.
    """
    w = 2.0 * math.pi * elastic.frequency
    force = elastic.rider * (w * w * (x - rider) + 2.0 * elastic.ratio * w * (v - speed))
    # Semi-implicit Euler: the speed first, which keeps the oscillation's energy.
    speed += h * force / elastic.rider
    return force, rider + h * speed, speed


@numba.njit
def _imposed_force(
    friction: FrictionTruth, elastic: ElasticTruth, x: Array, h: float, mass: float
) -> Array:
    """Return the force that moves the end of a bench as prescribed, N, at every step."""
    # The motion starts from rest: bristle and springs are slack.
    force, z, inner = np.zeros(len(x)), 0.0, x[0]
    rider, speed = x[0], 0.0
    for n in range(1, len(x)):
        time, v = n * h, (x[n] - x[n - 1]) / h
        if elastic.frame > 0.0:
            # The end moves the damper through the spring of the frame. The resistance grows with
            # the speed, so bisection finds the speed at which both forces are equal.
            inner_speed, low, high = v, -FASTEST, FASTEST
            for _ in range(HALVINGS):
                inner_speed = 0.5 * (low + high)
                # The bristle of a trial speed is dropped: only the final one is a step.
                resistance, _z = step_friction(friction, z, inner_speed, 0.0, time, h)
                inner_position = inner + inner_speed * h
                if (
                    elastic.frame * (x[n] - inner_position)
                    - resistance
                    - elastic_force(elastic, inner_position)
                    > 0.0
                ):
                    low = inner_speed
                else:
                    high = inner_speed
            resistance, z = step_friction(friction, z, inner_speed, 0.0, time, h)
            inner += inner_speed * h
            force[n] = elastic.frame * (x[n] - inner)
        else:
            resistance, z = step_friction(friction, z, v, 0.0, time, h)
            force[n] = resistance + elastic_force(elastic, x[n])
        if elastic.rider > 0.0:
            rider_force, rider, speed = carry_rider(elastic, x[n], v, rider, speed, h)
            force[n] += rider_force
        # Second difference of the prescribed motion: the inertia of the moved end.
        if n > 1:
            force[n] += mass * (x[n] - 2.0 * x[n - 1] + x[n - 2]) / (h * h)
    return force


def imposed_force(
    friction: FrictionTruth, elastic: ElasticTruth, x: Array, period: float, mass: float = 0.0
) -> Array:
    """Return the force at every tick, N, for a motion at every integration step, m; mass: kg."""
    # The motion is sampled at every integration step, the force at every tick.
    return _imposed_force(friction, elastic, x, period / FINE, mass)[::FINE]


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


def read_sensor(
    random: np.random.Generator, signal: Array, sensor: SensorTruth, period: float
) -> Array:
    """Return the readings of a sensor and its logger, in the unit of the signal."""
    ticks = np.arange(len(signal))
    # Delay first: eccentricity and noise are those of the delayed sample.
    reading = np.interp(ticks - sensor.delay / period, ticks, signal)
    reading = reading + sensor.eccentric * sensor.pitch * np.sin(
        2.0 * math.pi * reading / sensor.pitch
    )
    reading = (
        reading
        + sensor.noise * random.standard_normal(len(signal))
        + _coloured_noise(random, sensor, len(ticks), period)
    )
    return np.round(reading / sensor.bit) * sensor.bit if sensor.bit > 0.0 else reading


def _coloured_noise(
    random: np.random.Generator, sensor: SensorTruth, count: int, period: float
) -> Array:
    """Return noise below a corner frequency, in the unit of the sensor."""
    if sensor.coloured == 0.0:
        return np.zeros(count)
    # Shaped in the frequency domain, and scaled to the stated rms afterwards.
    white = np.fft.rfft(random.standard_normal(count))
    frequency = np.fft.rfftfreq(count, period)
    fade_speed = np.fft.irfft(white / (1.0 + (frequency / sensor.corner) ** 2), count)
    return sensor.coloured * fade_speed / float(np.std(fade_speed))
