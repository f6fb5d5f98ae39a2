"""What experiments are made of: time, random numbers, and the grounds that several share."""

from __future__ import annotations

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import road_profile


def time_of(configuration: Configuration) -> Array:
    """Time of every tick, s."""
    return np.arange(configuration.ticks) * configuration.timing.period


def random_of(seed: int) -> np.random.Generator:
    """The excitation's random numbers; the sensors' noise has a stream of its own from the same
    seed."""
    return np.random.default_rng([seed, 1])


def flat_ground(configuration: Configuration, seed: int) -> Array:
    """No ground motion: the response to the initial conditions alone."""
    return np.zeros((configuration.ticks, 3))


def road_ground(configuration: Configuration, seed: int) -> Array:
    """The road of the configuration."""
    demands = np.zeros((configuration.ticks, 3))
    demands[:, 0] = road_profile(configuration.road, time_of(configuration), random_of(seed))
    return demands
