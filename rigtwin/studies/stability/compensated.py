"""The structure cylinder's delay compensator from what the cylinder is, and the vehicles that it
makes testable.

What a diagnosis or a calibration found of the cylinder's lag, gain and delay is in its parameters,
so the corrected plant's cylinder gives the corrected compensator.
"""

from __future__ import annotations

import numpy as np

from controllers.kalman_inverse import Actuator, Weights, kalman_inverse
from controllers.linear_law import LinearLaw
from rigtwin.components import Cylinder
from rigtwin.components.cylinder import state_space
from rigtwin.description.configuration import Configuration

WEIGHTS = Weights(effort=1e-3, derivatives=3, desired_noise=1e-4, sensor_noise=1e-3)
"""The position's sensor has some 2e-4 m of hum, and the structure model is driven by a noisy load
cell: the filter trusts its model, and does not differentiate what is desired exactly. With the
position trusted ten times as much the hum trips a test at once."""


def actuator_of(cylinder: Cylinder) -> Actuator:
    """A cylinder from its command to the plate: its closed loop, after its own lag, gain and
    delay."""
    inner, entry, out = (np.asarray(part, dtype=np.float64) for part in state_space(cylinder))
    if cylinder.lag <= 0.0:
        return Actuator(inner, entry * cylinder.gain, out, cylinder.delay)
    size = len(inner)
    a, b = np.zeros((size + 1,) * 2), np.zeros(size + 1)
    a[:size, :size], a[:size, size] = inner, entry
    a[size, size], b[size] = -1.0 / cylinder.lag, cylinder.gain / cylinder.lag
    return Actuator(a, b, np.append(out, 0.0), cylinder.delay)


def plate_compensator(cylinder: Cylinder, period: float) -> LinearLaw:
    """The Kalman-filtered inverse of a cylinder at the controller's period, s."""
    return kalman_inverse(actuator_of(cylinder), period, WEIGHTS)


def with_filters(configuration: Configuration, time: float) -> Configuration:
    """The test with all three filters of the controller at that time constant, s."""
    controller = configuration.controller._replace(
        filter_position=time, filter_velocity=time, filter_force=time
    )
    return configuration._replace(controller=controller)


def with_cylinder_delay(configuration: Configuration, delay: float) -> Configuration:
    """The test on a rig whose structure cylinder has that pure delay, s."""
    plant = configuration.plant
    late = plant.structure_cylinder._replace(delay=delay)
    return configuration._replace(plant=plant._replace(structure_cylinder=late))
