"""What an experiment is: a configuration, and what it demands of the rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Experiment:
    """A test that can be run by name; picklable, since its demands are a function of a module.

    Parameters
    ----------
    name, summary, source : str
        What it is called, what it does, where it comes from.
    configuration : Configuration
        The rig, its controller and the clocks.
    demands : callable
        Of a configuration and a seed, the columns of `controllers.Demand` at every tick, shape
        (ticks, 3): ground m, structure m, force N. The last two count in imposed tests only.
    """

    name: str
    summary: str
    source: str
    configuration: Configuration
    demands: Callable[[Configuration, int], Array]
