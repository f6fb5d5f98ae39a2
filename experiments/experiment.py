"""What an experiment is: a configuration, and what it demands of the rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import road_profile

Progress = Callable[[int], object]
"""Called with the steps done since its last call."""


@dataclass(frozen=True)
class Experiment:
    """A test that can be run by name.

    demands: of (configuration, seed), the columns of controllers.Demand at every tick, shape (ticks, 3): ground m,
    structure m, force N; the last two count in imposed tests only.
    """

    name: str
    summary: str
    source: str
    configuration: Configuration
    demands: Callable[[Configuration, int], Array]


def time_of(configuration: Configuration) -> Array:
    """Time of every tick, s."""
    return np.arange(configuration.ticks) * configuration.timing.period


def random_of(seed: int) -> np.random.Generator:
    """The excitation's random numbers; the sensors' noise has a stream of its own from the same seed."""
    return np.random.default_rng([seed, 1])


def flat_ground(configuration: Configuration, seed: int) -> Array:
    """No ground motion: the response to the initial conditions alone."""
    return np.zeros((configuration.ticks, 3))


def road_ground(configuration: Configuration, seed: int) -> Array:
    """The road of the configuration."""
    demands = np.zeros((configuration.ticks, 3))
    demands[:, 0] = road_profile(configuration.road, time_of(configuration), random_of(seed))
    return demands
