"""Building blocks of experiments: time, random numbers and the shared ground motions."""

from __future__ import annotations

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import road_profile


def time_of(configuration: Configuration) -> Array:
    """Return the time of every tick, s, shape (ticks,)."""
    return np.arange(configuration.ticks) * configuration.timing.period


def random_of(seed: int) -> np.random.Generator:
    """Return the random generator of the excitation.

    The sensor noise of a test draws from a separate stream of the same seed.
    """
    # The stream number 1 keeps the excitation independent of the noise: a longer test or another
    # sensor leaves the road as it was.
    return np.random.default_rng([seed, 1])


def flat_ground(configuration: Configuration, seed: int) -> Array:
    """Return zero demands, shape (ticks, 3): the response to the initial conditions alone."""
    return np.zeros((configuration.ticks, 3))


def road_ground(configuration: Configuration, seed: int) -> Array:
    """Return demands that drive over the configured road: ground m, structure m, force N."""
    demands = np.zeros((configuration.ticks, 3))
    demands[:, 0] = road_profile(configuration.road, time_of(configuration), random_of(seed))
    return demands
