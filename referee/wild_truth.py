"""Machines whose physics have other forms than the library's: written from textbooks and from
nothing of the twin.

Friction is a bristle (Canudas de Wit et al., A new model for control of systems with friction, IEEE
TAC 40(3), 1995), stepped implicitly; or a tanh of speed. It may grow with the load and fall as the
machine warms up.
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
"""Steps a tick."""
FASTEST, HALVINGS = 50.0, 60
"""m/s, and how often they are halved, of what moves behind a spring."""


class Rubbing(NamedTuple):
    """What resists a motion, in N, m and s, or Nm and rad. slip: kinetic friction; breakaway: times
    that, of a stick; slow: speed at which it fades; bristle: deflection at which it slips; smooth:
    speed over which a tanh changes sign, 0 of a bristle; by_load: friction for each N of load;
    viscous: for each m/s; cooled: share of all of it that warming up takes away, within `warming`
    s; worn: share of the viscous part that is gone after 1 s."""

    slip: float = 0.0
    breakaway: float = 1.0
    slow: float = 0.01
    bristle: float = 1e-6
    smooth: float = 0.0
    by_load: float = 0.0
    viscous: float = 0.0
    cooled: float = 0.0
    warming: float = 1.0
    worn: float = 0.0


class Bending(NamedTuple):
    """Springs and waves. rate: N/m about 0; cubic: N/m³; ripple: N, along the way, and its pitch m
    and phase; rider: a second mass kg on a spring of that frequency Hz and damping ratio; frame:
    N/m of what the machine stands on, 0 if rigid."""

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
class Sensing:
    """noise: rms of white noise; coloured: rms of noise below `corner` Hz; bit; eccentric: share by
    which an encoder's reading waves along its pitch; late: s by which a channel is stamped."""

    noise: float = 0.0
    coloured: float = 0.0
    corner: float = 2.0
    bit: float = 0.0
    eccentric: float = 0.0
    pitch: float = 0.1
    late: float = 0.0


@numba.njit
def rub(r: Rubbing, z: float, v: float, load: float, time: float, h: float) -> tuple[float, float]:
    """(friction, the bristle's deflection after the step)."""
    warm = 1.0 - r.cooled * (1.0 - math.exp(-time / r.warming))
    fade = math.exp(-((v / r.slow) ** 2))
    size = warm * (r.slip * (1.0 + (r.breakaway - 1.0) * fade) + r.by_load * abs(load))
    viscous = warm * r.viscous * max(1.0 - r.worn * time, 0.0) * v
    if r.smooth > 0.0:
        return size * math.tanh(v / r.smooth) + viscous, z
    z = (z + v * h) / (1.0 + abs(v) * h / r.bristle)
    return size * z / r.bristle + viscous, z


@numba.njit
def bend(b: Bending, x: float) -> float:
    """The force that depends on the place alone."""
    wave = b.ripple * math.sin(2.0 * math.pi * x / b.pitch + b.phase)
    return b.rate * x + b.cubic * x**3 + wave


@numba.njit
def _hold(r: Rubbing, b: Bending, x: Array, h: float, mass: float) -> Array:
    """The force that moves a bench's end as prescribed, over the fine steps."""
    force, z, inner = np.zeros(len(x)), 0.0, x[0]
    rider, speed = x[0], 0.0
    w = 2.0 * math.pi * b.frequency
    for n in range(1, len(x)):
        time, v = n * h, (x[n] - x[n - 1]) / h
        if b.frame > 0.0:
            # The end moves the damper through a spring: its speed by bisection, as what resists
            # grows with it.
            v_in, low, high = v, -FASTEST, FASTEST
            for _ in range(HALVINGS):
                v_in = 0.5 * (low + high)
                f, _z = rub(r, z, v_in, 0.0, time, h)
                place = inner + v_in * h
                if b.frame * (x[n] - place) - f - bend(b, place) > 0.0:
                    low = v_in
                else:
                    high = v_in
            f, z = rub(r, z, v_in, 0.0, time, h)
            inner += v_in * h
            force[n] = b.frame * (x[n] - inner)
        else:
            f, z = rub(r, z, v, 0.0, time, h)
            force[n] = f + bend(b, x[n])
        if b.rider > 0.0:
            pull = b.rider * (w * w * (x[n] - rider) + 2.0 * b.ratio * w * (v - speed))
            speed += h * pull / b.rider
            rider += h * speed
            force[n] += pull
        if n > 1:
            force[n] += mass * (x[n] - 2.0 * x[n - 1] + x[n - 2]) / (h * h)
    return force


def hold(r: Rubbing, b: Bending, x: Array, period: float, mass: float = 0.0) -> Array:
    """The force at every tick for a motion given at the fine steps."""
    return _hold(r, b, x, period / FINE, mass)[::FINE]


@numba.njit
def _drive(
    r: Rubbing,
    b: Bending,
    mass: float,
    arm: float,
    start: float,
    torque: Array,
    sag: float,
    h: float,
    fine: int,
) -> Array:
    """Position at every tick under a recorded force; arm: weight times lever of a pendulum, Nm."""
    x, v, z, rider, speed = start, 0.0, 0.0, start, 0.0
    w = 2.0 * math.pi * b.frequency
    out = np.zeros(len(torque))
    for tick in range(len(torque)):
        out[tick] = x
        command = torque[tick]
        push = command / (1.0 + sag * abs(command))
        for k in range(fine):
            load = arm * math.cos(x) + mass * v * v
            f, z = rub(r, z, v, load, (tick * fine + k) * h, h)
            total = push - f - bend(b, x) - arm * math.sin(x)
            if b.rider > 0.0:
                pull = b.rider * (w * w * (x - rider) + 2.0 * b.ratio * w * (v - speed))
                speed += h * pull / b.rider
                rider += h * speed
                total -= pull
            v += h * total / mass
            x += h * v
    return out


def drive(
    r: Rubbing,
    b: Bending,
    mass: float,
    arm: float,
    start: float,
    torque: Array,
    sag: float,
    period: float,
) -> Array:
    """The same; the bristle needs steps that are fine beside its own frequency."""
    size = max(r.slip * r.breakaway + r.by_load * (arm + mass), 1e-9)
    stiffness = size / r.bristle if r.smooth == 0.0 else size / r.smooth / period
    fine = max(FINE, math.ceil(4.0 * period * math.sqrt(stiffness / mass)))
    return _drive(r, b, mass, arm, start, torque, sag, period / fine, fine)


@numba.njit
def _carriage(
    r: Rubbing,
    b: Bending,
    mass: float,
    gains: tuple[float, float, float],
    reference: Array,
    noise: Array,
    sag: float,
    bit: float,
    period: float,
    fine: int,
) -> tuple[Array, Array]:
    """(position read, force commanded) of a carriage under a cascade of position and velocity
    control."""
    to_force, kp, kv = gains
    x, v, z, rider, speed = reference[0], 0.0, 0.0, reference[0], 0.0
    w, h = 2.0 * math.pi * b.frequency, period / fine
    read, force = np.zeros(len(reference)), np.zeros(len(reference))
    last, mean_before = reference[0], reference[0]
    for tick in range(len(reference)):
        sensed = x + noise[tick]
        if bit > 0.0:
            sensed = round(sensed / bit) * bit
        mean = 0.5 * (sensed + last)
        rate = 0.0 if tick == 0 else (mean - mean_before) / period
        last, mean_before = sensed, mean
        command = to_force * (kp * kv * (reference[tick] - sensed) - kv * rate)
        read[tick], force[tick] = sensed, command
        push = command / (1.0 + sag * abs(command))
        for k in range(fine):
            f, z = rub(r, z, v, 0.0, (tick * fine + k) * h, h)
            total = push - f - bend(b, x)
            if b.rider > 0.0:
                pull = b.rider * (w * w * (x - rider) + 2.0 * b.ratio * w * (v - speed))
                speed += h * pull / b.rider
                rider += h * speed
                total -= pull
            v += h * total / mass
            x += h * v
    return read, force


def carriage(
    r: Rubbing,
    b: Bending,
    mass: float,
    gains: tuple[float, float, float],
    reference: Array,
    noise: Array,
    sag: float,
    bit: float,
    period: float,
) -> tuple[Array, Array]:
    """The same with steps that are fine beside the bristle's own frequency."""
    stiffness = r.slip * r.breakaway / r.bristle if r.smooth == 0.0 else 0.0
    fine = max(FINE, math.ceil(4.0 * period * math.sqrt(stiffness / mass)))
    return _carriage(r, b, mass, gains, reference, noise, sag, bit, period, fine)


@dataclass(frozen=True)
class Following:
    """A positioning actuator. lag: s; late: s; fastest: m/s that its speed nears softly, 0 for
    none; loose: m of play; fades: share of its gain that is gone after 1 s; own: natural frequency
    Hz and damping ratio of a load on a spring behind it, or none; curved: share by which its lag
    grows with the error, per m."""

    lag: float = 0.0
    late: float = 0.0
    fastest: float = 0.0
    loose: float = 0.0
    fades: float = 0.0
    own: tuple[float, float] | None = None
    curved: float = 0.0


@numba.njit
def _follow(
    command: Array,
    lag: float,
    fastest: float,
    loose: float,
    own: tuple[float, float],
    curved: float,
    h: float,
) -> Array:
    place, carried, end, speed = command[0], command[0], command[0], 0.0
    w = 2.0 * math.pi * own[0]
    out = np.zeros(len(command))
    for n in range(len(command)):
        carried = min(max(carried, command[n] - loose), command[n] + loose)
        error = carried - place
        slow = lag * (1.0 + curved * abs(error))
        rate = error * (1.0 - math.exp(-h / slow)) / h if lag > 0.0 else error / h
        if fastest > 0.0:
            rate = fastest * math.tanh(rate / fastest)
        place += h * rate
        if w > 0.0:
            speed += h * (w * w * (place - end) - 2.0 * own[1] * w * speed)
            end += h * speed
            out[n] = end
        else:
            out[n] = place
    return out


def follow(truth: Following, command: Array, period: float) -> Array:
    """Where the actuator is at every tick, under a command held from tick to tick."""
    h = period / FINE
    held = np.repeat(command, FINE)
    held *= 1.0 - truth.fades * np.arange(len(held)) * h
    behind = round(truth.late / h)
    if behind:
        held = np.concatenate([np.full(behind, held[0]), held[:-behind]])
    own = truth.own or (0.0, 0.0)
    moved = _follow(held, truth.lag, truth.fastest, 0.5 * truth.loose, own, truth.curved, h)
    return np.concatenate([[held[0]], moved[FINE - 1 :: FINE][:-1]])


def sense(random: np.random.Generator, signal: Array, by: Sensing, period: float) -> Array:
    """What a sensor and its logger make of a signal."""
    ticks = np.arange(len(signal))
    read = np.interp(ticks - by.late / period, ticks, signal)
    read = read + by.eccentric * by.pitch * np.sin(2.0 * math.pi * read / by.pitch)
    read = (
        read
        + by.noise * random.standard_normal(len(signal))
        + _colour(random, by, len(ticks), period)
    )
    return np.round(read / by.bit) * by.bit if by.bit > 0.0 else read


def _colour(random: np.random.Generator, by: Sensing, count: int, period: float) -> Array:
    """Noise below a corner frequency."""
    if by.coloured == 0.0:
        return np.zeros(count)
    white = np.fft.rfft(random.standard_normal(count))
    frequency = np.fft.rfftfreq(count, period)
    slow = np.fft.irfft(white / (1.0 + (frequency / by.corner) ** 2), count)
    return by.coloured * slow / float(np.std(slow))
