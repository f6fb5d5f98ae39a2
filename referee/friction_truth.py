"""Friction and elasticity of the wild referee's machines."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba


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
