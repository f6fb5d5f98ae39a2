"""Two benches of the referee's: a positioning actuator and a damper. Written from their physics and
from nothing of the twin.

The actuator is integrated in steps of 50 us: each lag by the trapezoidal rule, a delay by shifting
the command. The damper's dry friction is a stop operator in the stretch of what stands between
piston and rod: the play, then the spring, then the slider.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE = 20
"""Steps a tick."""


@dataclass(frozen=True)
class ActuatorTruth:
    """lags: s, one after another; late: s; own: (natural frequency Hz, damping ratio) or none;
    fastest: m/s; lost: m of play."""

    lags: tuple[float, ...] = ()
    late: float = 0.0
    own: tuple[float, float] | None = None
    scale: float = 1.0
    fastest: float = math.inf
    lost: float = 0.0


@dataclass(frozen=True)
class DamperTruth:
    """slip: N; spring: N/m in series with it, infinite if rigid; lost: m of play in series;
    viscous: Ns/m when extending and when compressing; rate: N/m beside them; charge: N."""

    slip: float = 0.0
    spring: float = math.inf
    lost: float = 0.0
    viscous: tuple[float, float] = (0.0, 0.0)
    rate: float = 0.0
    charge: float = 0.0
    square: float = 0.0


def wander(
    random: np.random.Generator,
    seconds: float,
    period: float,
    reach: float,
    lowest: float,
    highest: float,
) -> Array:
    """A motion without end of many sines of falling size, at most `reach` m from its middle, from
    rest."""
    time = np.arange(round(seconds / period)) * period
    frequencies = np.geomspace(lowest, highest, 25) * random.uniform(0.97, 1.03, 25)
    phases = random.uniform(0.0, 2.0 * math.pi, 25)
    motion = sum(
        np.sin(2 * math.pi * f * time + p) / (1.0 + f)
        for f, p in zip(frequencies, phases, strict=True)
    )
    eased = np.clip(time / 0.5, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(time / 0.5, 0.0, 1.0))
    motion = np.asarray(motion) * eased
    return reach * motion / float(np.max(np.abs(motion)))


@numba.njit
def _integrate(
    wanted: Array, lags: Array, own: Array, fastest: float, half: float, step: float
) -> Array:
    levels = np.full(len(lags), wanted[0])
    place, speed, out, held = wanted[0], 0.0, np.empty(len(wanted)), wanted[0]
    carried = wanted[0]
    before = np.full(len(lags) + 1, wanted[0])
    for n in range(len(wanted)):
        carried = min(max(carried, wanted[n] - half), wanted[n] + half)
        held += min(max(carried - held, -fastest * step), fastest * step)
        now = held
        for k in range(len(lags)):
            a = step / (2.0 * lags[k])
            level = ((1.0 - a) * levels[k] + a * (now + before[k])) / (1.0 + a)
            before[k] = now
            levels[k] = level
            now = level
        if own[0] > 0.0:
            # Midpoint rule.
            w = 2.0 * math.pi * own[0]
            mid_speed = speed + 0.5 * step * (w * w * (now - place) - 2.0 * own[1] * w * speed)
            mid_place = place + 0.5 * step * speed
            speed += step * (w * w * (now - mid_place) - 2.0 * own[1] * w * mid_speed)
            place += step * mid_speed
            now = place
        out[n] = now
    return out


def actuator_position(truth: ActuatorTruth, command: Array, period: float) -> Array:
    """Where the actuator is at every tick, under a command held from tick to tick."""
    step = period / FINE
    held = np.repeat(truth.scale * command, FINE)
    behind = round(truth.late / step)
    if behind:
        held = np.concatenate([np.full(behind, held[0]), held[:-behind]])
    own = np.array(truth.own or (0.0, 0.0))
    moved = _integrate(
        held, np.array(truth.lags, float), own, truth.fastest, 0.5 * truth.lost, step
    )
    # A sample is taken before the command of its tick acts.
    return np.concatenate([[held[0]], moved[FINE - 1 :: FINE][:-1]])


def damper_force(truth: DamperTruth, motion: Array, speed: Array) -> Array:
    """The force that moves the piston so, at every tick."""
    viscous = np.where(
        speed > 0.0, truth.viscous[0], truth.viscous[1]
    ) * speed + truth.square * speed * np.abs(speed)
    spring = min(truth.spring, 1e9)
    most = truth.slip / spring + 0.5 * truth.lost
    stretch, dry = 0.0, np.empty(len(motion))
    last = motion[0]
    for n, here in enumerate(motion):
        stretch = min(max(stretch + here - last, -most), most)
        last = here
        beyond = max(abs(stretch) - 0.5 * truth.lost, 0.0)
        dry[n] = math.copysign(spring * beyond, stretch)
    return dry + viscous + truth.rate * motion + truth.charge


def sample(random: np.random.Generator, signal: Array, noise: float, bit: float) -> Array:
    """What a converter makes of a signal."""
    noisy = signal + noise * random.standard_normal(len(signal))
    return np.round(noisy / bit) * bit if bit > 0.0 else noisy
