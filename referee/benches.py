"""Two benches of the referee: a positioning actuator and a damper.

Both are written from physics and share no code with the twin. The actuator is integrated with
`FINE` steps per tick: every lag by the trapezoidal rule, a delay by shifting the command. The dry
friction of the damper is a stop operator on the stretch of play, spring and slider in series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE = 20
"""Integration steps per tick."""


@dataclass(frozen=True)
class ActuatorTruth:
    """Parameters of the positioning actuator.

    Attributes
    ----------
    lags : tuple of float
        Time constants of first-order lags in series, s.
    delay : float
        Delay of the command, s.
    resonance : tuple of float, optional
        Natural frequency, Hz, and damping ratio of the load. None for a rigid load.
    gain : float
        Gain of the command.
    speed_limit : float
        Largest speed, m/s.
    play : float
        Play between command and actuator, m.
    """

    lags: tuple[float, ...] = ()
    delay: float = 0.0
    resonance: tuple[float, float] | None = None
    gain: float = 1.0
    speed_limit: float = math.inf
    play: float = 0.0


@dataclass(frozen=True)
class DamperTruth:
    """Parameters of the damper.

    Attributes
    ----------
    slip : float
        Coulomb friction, N.
    spring : float
        Stiffness in series with the friction, N/m. Infinite if rigid.
    play : float
        Play in series with the friction, m.
    viscous : tuple of float
        Damping in extension and in compression, Ns/m.
    stiffness, preload : float
        Spring parallel to the damper, N/m, and its preload, N.
    quadratic : float
        Drag coefficient of the squared speed, N/(m/s)².
    """

    slip: float = 0.0
    spring: float = math.inf
    play: float = 0.0
    viscous: tuple[float, float] = (0.0, 0.0)
    stiffness: float = 0.0
    preload: float = 0.0
    quadratic: float = 0.0


def wander(
    random: np.random.Generator,
    seconds: float,
    period: float,
    reach: float,
    lowest: float,
    highest: float,
) -> Array:
    """Return a random motion from rest, m, shape (ticks,): many sines of falling amplitude.

    Parameters
    ----------
    random : Generator
        Source of frequencies and phases.
    seconds, period : float
        Length and sample period, s.
    reach : float
        Largest deviation from the middle, m.
    lowest, highest : float
        Range of the frequencies, Hz.
    """
    time = np.arange(round(seconds / period)) * period
    # Frequencies off a common grid: the motion does not repeat.
    frequencies = np.geomspace(lowest, highest, 25) * random.uniform(0.97, 1.03, 25)
    phases = random.uniform(0.0, 2.0 * math.pi, 25)
    motion = sum(
        np.sin(2 * math.pi * f * time + p) / (1.0 + f)
        for f, p in zip(frequencies, phases, strict=True)
    )
    # Smoothstep over the first half second: the motion starts at rest.
    eased = np.clip(time / 0.5, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(time / 0.5, 0.0, 1.0))
    motion = np.asarray(motion) * eased
    return reach * motion / float(np.max(np.abs(motion)))


@numba.njit
def _integrate(
    demand: Array, lags: Array, resonance: Array, speed_limit: float, half_play: float, step: float
) -> Array:
    """Return the actuator's position at every integration step, m; step: s."""
    levels = np.full(len(lags), demand[0])
    position, speed, out, limited = demand[0], 0.0, np.empty(len(demand)), demand[0]
    after_play = demand[0]
    # The trapezoidal rule needs the input of the step before, for every lag.
    previous = np.full(len(lags) + 1, demand[0])
    for n in range(len(demand)):
        after_play = min(max(after_play, demand[n] - half_play), demand[n] + half_play)
        # The speed limit acts before the lags, as that of a controller's ramp does.
        limited += min(max(after_play - limited, -speed_limit * step), speed_limit * step)
        value = limited
        for k in range(len(lags)):
            # Trapezoidal rule for T ẏ + y = u, exact in phase to second order.
            half_step = step / (2.0 * lags[k])
            level = ((1.0 - half_step) * levels[k] + half_step * (value + previous[k])) / (
                1.0 + half_step
            )
            previous[k] = value
            levels[k] = level
            value = level
        if resonance[0] > 0.0:
            # Midpoint rule: explicit Euler would add energy to the oscillation.
            w = 2.0 * math.pi * resonance[0]
            mid_speed = speed + 0.5 * step * (
                w * w * (value - position) - 2.0 * resonance[1] * w * speed
            )
            mid_position = position + 0.5 * step * speed
            speed += step * (w * w * (value - mid_position) - 2.0 * resonance[1] * w * mid_speed)
            position += step * mid_speed
            value = position
        out[n] = value
    return out


def actuator_position(truth: ActuatorTruth, command: Array, period: float) -> Array:
    """Return the position of the actuator at every tick, m, with the command held over a tick."""
    step = period / FINE
    held = np.repeat(truth.gain * command, FINE)
    delay_steps = round(truth.delay / step)
    if delay_steps:
        held = np.concatenate([np.full(delay_steps, held[0]), held[:-delay_steps]])
    resonance = np.array(truth.resonance or (0.0, 0.0))
    positions = _integrate(
        held, np.array(truth.lags, float), resonance, truth.speed_limit, 0.5 * truth.play, step
    )
    # A sample is taken before the command of its tick acts.
    return np.concatenate([[held[0]], positions[FINE - 1 :: FINE][:-1]])


def damper_force(truth: DamperTruth, motion: Array, speed: Array) -> Array:
    """Return the force that moves the piston as prescribed, N; motion: m, speed: m/s, (n,)."""
    viscous = np.where(
        speed > 0.0, truth.viscous[0], truth.viscous[1]
    ) * speed + truth.quadratic * speed * np.abs(speed)
    # A rigid connection is a very stiff spring, so both use the same operator.
    spring = min(truth.spring, 1e9)
    # The stop operator lets the slider follow beyond this stretch.
    largest_stretch = truth.slip / spring + 0.5 * truth.play
    stretch, dry = 0.0, np.empty(len(motion))
    previous = motion[0]
    for n, position in enumerate(motion):
        stretch = min(max(stretch + position - previous, -largest_stretch), largest_stretch)
        previous = position
        spring_stretch = max(abs(stretch) - 0.5 * truth.play, 0.0)
        dry[n] = math.copysign(spring * spring_stretch, stretch)
    return dry + viscous + truth.stiffness * motion + truth.preload


def sample(random: np.random.Generator, signal: Array, noise: float, bit: float) -> Array:
    """Return a signal with white noise, rms, rounded to a bit, both in its unit."""
    noisy = signal + noise * random.standard_normal(len(signal))
    return np.round(noisy / bit) * bit if bit > 0.0 else noisy
