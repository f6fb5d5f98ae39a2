"""One test of a study: simulated on the twin in memory and compared with the ideal system."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from experiments import find
from experiments.thesis.entry import Entry, digits
from experiments.thesis.study import Job, Result
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import rms
from rigtwin.simulation.ideal import Ideal, simulate_ideal
from rigtwin.simulation.metrics import compute_tracking
from rigtwin.simulation.runner import SimulationResult, simulate
from rigtwin.simulation.trip import Trip, explain_trip

BODY = 3.0
"""Highest frequency counted in the acceleration of the body, Hz.

The road of chapter 7 ends at 1.6 Hz. The twin's friction limit cycle begins at 3.4 Hz; its size
depends on controller gains that the thesis does not give.
"""
SHOWN = 20
"""Ticks between the samples of a curve stored for drawing."""


@dataclass(frozen=True)
class ThesisTrial:
    """A test on the twin, and the same test of the ideal system.

    Attributes
    ----------
    configuration : Configuration
        Settings of the test.
    simulation : SimulationResult
        Commands, measurements and true values of the twin.
    ideal : Ideal
        Motion of the ideal system on the same ground.
    """

    configuration: Configuration
    simulation: SimulationResult
    ideal: Ideal

    @property
    def time(self) -> Array:
        """Time of every tick, s, shape (ticks,)."""
        return np.arange(len(self.simulation.commands)) * self.configuration.timing.period

    @property
    def plate(self) -> Array:
        """True position of the structure plate, m, shape (ticks,)."""
        return self.simulation.truth[:, 1]

    @property
    def travel(self) -> Array:
        """True suspension travel, m, shape (ticks,)."""
        return self.simulation.truth[:, 2]

    @property
    def wheel(self) -> Array:
        """True position of the wheel, m, shape (ticks,): plate minus travel."""
        return self.simulation.truth[:, 1] - self.simulation.truth[:, 2]

    @property
    def force(self) -> Array:
        """True suspension force, N, shape (ticks,)."""
        return self.simulation.truth[:, 3]


def trial(
    name: str, seed: int, change: Callable[[Configuration], Configuration] = lambda c: c
) -> ThesisTrial:
    """Run a named experiment on the twin and on the ideal system.

    Parameters
    ----------
    name : str
        Name of the experiment.
    seed : int
        Seed of the road and of the sensor noise.
    change : callable
        Function that changes the configuration. Defaults to none.

    Returns
    -------
    Trial
        Both results.

    Raises
    ------
    RigtwinError
        If the test ends early at a limit.
    """
    experiment = find(name)
    configuration = change(experiment.configuration)
    demands = experiment.demands(configuration, seed)
    simulated = simulate(configuration, demands, seed)
    if simulated.trip != Trip.NONE:
        raise RigtwinError(
            f"{name} with seed {seed}: {explain_trip(simulated.trip, configuration.safety)} "
            f"after {len(simulated.commands)} ticks"
        )
    # The ideal system gets the commanded ground, so the ground cylinder's lag is not an error of
    # the suspension.
    return ThesisTrial(
        configuration, simulated, simulate_ideal(configuration, simulated.commands[:, 0])
    )


def errors(test: ThesisTrial) -> dict[str, float]:
    """Return the rms errors of position, m, and force, N, and the ideal's rms about its mean.

    e1 is ideal minus demanded, e2 demanded minus true (§3.6); `total` is the rms of e1 + e2.
    """
    tracking = compute_tracking(test.ideal, test.simulation.commands, test.plate, test.force)
    swing = {
        "ideal_position": float(np.std(test.ideal.structure)),
        "ideal_force": float(np.std(test.ideal.force)),
    }
    return {**vars(tracking), **swing}


def body_acceleration(position: Array, period: float) -> float:
    """Return the rms acceleration of the body up to `BODY` Hz, m/s², from its position, m."""
    # Filtered before it is differentiated twice, and forwards and backwards: no phase lag.
    smooth = sosfiltfilt(butter(2, BODY, fs=1.0 / period, output="sos"), position)
    return rms(np.diff(smooth, 2) / period**2)


def vehicle(where: str, configuration: Configuration) -> list[Entry]:
    """Return the entries of the quarter car's parameters (Tables 6.2 and 7.1)."""
    settings, plant = configuration.controller, configuration.plant
    return [
        digits(where, "sprung mass", "25", settings.sprung_mass, "kg"),
        digits(where, "suspension stiffness", "1000", settings.suspension_stiffness, "N/m"),
        digits(where, "suspension damping", "50", settings.suspension_damping, "Ns/m"),
        digits(where, "unsprung mass", "34", plant.carriage.mass, "kg"),
        digits(where, "tyre stiffness", "50000", plant.tyre.stiffness, "N/m"),
        digits(where, "tyre damping", "0", plant.tyre.damping, "Ns/m"),
    ]


def curves(test: ThesisTrial) -> dict[str, Array]:
    """Return the curves to draw, every `SHOWN`-th tick, in mm, N and s."""
    shown = slice(None, None, SHOWN)
    signals = {
        "time": test.time,
        "ground": 1e3 * test.simulation.commands[:, 0],
        "asked position": 1e3 * test.simulation.commands[:, 1],
        "asked force": test.simulation.commands[:, 2],
        "plate": 1e3 * test.plate,
        "travel": 1e3 * test.travel,
        "wheel": 1e3 * test.wheel,
        "force": test.force,
        "ideal plate": 1e3 * test.ideal.structure,
        "ideal travel": 1e3 * (test.ideal.structure - test.ideal.wheel),
        "ideal wheel": 1e3 * test.ideal.wheel,
        "ideal force": test.ideal.force,
    }
    return {name: values[shown] for name, values in signals.items()}


def seeded(names: Mapping[str, Callable[[int], Result]], seeds: int) -> dict[str, Job]:
    """Return a job for each name and seed, with the key `name/seed`."""
    # The defaults bind the loop variables now; a closure would see their last values.
    return {
        f"{name}/{seed}": (lambda work=work, seed=seed: work(seed))
        for name, work in names.items()
        for seed in range(seeds)
    }


def over_seeds(results: Mapping[str, Result], name: str, value: str) -> Array:
    """Return one value of the results of all seeds, in the order of the seeds, shape (seeds,)."""
    # Seeds are sorted as numbers: differences between two tests pair equal roads.
    keys = [key for key in results if key.rpartition("/")[0] == name]
    return np.array(
        [
            float(results[key][value])
            for key in sorted(keys, key=lambda key: int(key.rpartition("/")[2]))
        ]
    )
