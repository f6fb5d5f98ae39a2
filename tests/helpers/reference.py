"""Independent integrations that the twin is checked against. They share no code with it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import njit

from rigtwin.numerics.arrays import Array


@njit
def coulomb_carriage(
    ground: Array,
    force: Array,
    step: float,
    mass: float,
    stiffness: float,
    friction: float,
    start: float,
    every: int,
) -> Array:
    """Carriage with set-valued dry friction on a tyre that only pushes; Moreau's time stepping.

    ground (m) and force (N, against +x) at every step; returns the position at every `every`-th
    step.
    """
    out = np.empty((len(ground) + every - 1) // every)
    position, velocity = start, 0.0
    for number in range(len(ground)):
        if number % every == 0:
            out[number // every] = position
        midpoint = position + 0.5 * step * velocity
        tyre = max(stiffness * (ground[number] - midpoint), 0.0)
        free = velocity + step * (tyre - force[number]) / mass
        impulse = step * friction / mass
        new = free - min(max(free, -impulse), impulse)
        position = midpoint + 0.5 * step * new
        velocity = new
    return out


def swing_dry(
    mass: float,
    lever: float,
    friction: float,
    start: tuple[float, float],
    time: Array,
    viscous: float = 0.0,
    push: Callable[[float, float, float], float] = lambda *_: 0.0,
) -> Array:
    """A point mass that swings about a hinge with set-valued dry friction; Moreau's time stepping
    in 50 steps a sample.

    mass kg, lever m, friction Nm, viscous Nms/rad, start rad and rad/s; push: Nm, by time, angle
    and rate at a sample, held until the next. Returns angle, rate and push at those times, which
    are evenly apart.
    """
    fine, inertia = 50, mass * lever**2
    step = float(time[1] - time[0]) / fine
    angle, rate = start
    out = np.empty((3, len(time)))
    for number, now in enumerate(time):
        torque = push(float(now), angle, rate)
        out[:, number] = angle, rate, torque
        for _ in range(fine):
            middle = angle + 0.5 * step * rate
            load = torque - mass * 9.81 * lever * math.sin(middle) - viscous * rate
            free = rate + step * load / inertia
            impulse = step * friction / inertia
            rate = free - min(max(free, -impulse), impulse)
            angle = middle + 0.5 * step * rate
    return out
