"""Force of a damper whose motion is imposed, for the wild referee."""

from __future__ import annotations

import numba
import numpy as np

from referee.friction_truth import (
    ElasticTruth,
    FrictionTruth,
    carry_rider,
    elastic_force,
    step_friction,
)
from referee.wild_truth import FASTEST, FINE, HALVINGS, Array


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
