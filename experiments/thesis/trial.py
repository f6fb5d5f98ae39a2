"""One test of a study: run on the twin in memory, beside the ideal system, and what of it is
kept."""

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
from rigtwin.simulation.safety import Trip, explain_trip

BODY = 3.0
"""Hz; up to which the body's motion is counted. The road of chapter 7 ends at 1.6 Hz, and the
twin's friction limit cycle, whose size depends on gains that the thesis does not give, begins at
3.4 Hz."""
SHOWN = 20
"""Ticks between the samples of a curve that is kept to be drawn."""


@dataclass(frozen=True)
class Trial:
    """A test, what the twin did, and what the ideal system would have done. truth columns: ground,
    structure, travel, force."""

    configuration: Configuration
    ran: SimulationResult
    should: Ideal

    @property
    def time(self) -> Array:
        return np.arange(len(self.ran.commands)) * self.configuration.timing.period

    @property
    def plate(self) -> Array:
        return self.ran.truth[:, 1]

    @property
    def travel(self) -> Array:
        return self.ran.truth[:, 2]

    @property
    def wheel(self) -> Array:
        return self.ran.truth[:, 1] - self.ran.truth[:, 2]

    @property
    def force(self) -> Array:
        return self.ran.truth[:, 3]


def trial(
    name: str, seed: int, change: Callable[[Configuration], Configuration] = lambda c: c
) -> Trial:
    """Runs an experiment, with its configuration changed. Raises RigtwinError if it trips."""
    experiment = find(name)
    configuration = change(experiment.configuration)
    demands = experiment.demands(configuration, seed)
    ran = simulate(configuration, demands, seed)
    if ran.trip != Trip.NONE:
        raise RigtwinError(
            f"{name} with seed {seed}: {explain_trip(ran.trip, configuration.safety)} "
            f"after {len(ran.commands)} ticks"
        )
    return Trial(configuration, ran, simulate_ideal(configuration, ran.commands[:, 0]))


def errors(test: Trial) -> dict[str, float]:
    """rms e1, e2 and e1 + e2 of position (m) and force (N), and of what they are a share: the
    ideal's motion about its mean."""
    found = compute_tracking(test.should, test.ran.commands, test.plate, test.force)
    swing = {
        "ideal_position": float(np.std(test.should.structure)),
        "ideal_force": float(np.std(test.should.force)),
    }
    return {**vars(found), **swing}


def body_acceleration(position: Array, period: float) -> float:
    """rms acceleration of the body up to BODY Hz, m/s², of its position (m)."""
    smooth = sosfiltfilt(butter(2, BODY, fs=1.0 / period, output="sos"), position)
    return rms(np.diff(smooth, 2) / period**2)


def vehicle(where: str, configuration: Configuration) -> list[Entry]:
    """The quarter car of Tables 6.2 and 7.1 as a test has it."""
    settings, plant = configuration.controller, configuration.plant
    return [
        digits(where, "sprung mass", "25", settings.sprung_mass, "kg"),
        digits(where, "suspension stiffness", "1000", settings.suspension_stiffness, "N/m"),
        digits(where, "suspension damping", "50", settings.suspension_damping, "Ns/m"),
        digits(where, "unsprung mass", "34", plant.carriage.mass, "kg"),
        digits(where, "tyre stiffness", "50000", plant.tyre.stiffness, "N/m"),
        digits(where, "tyre damping", "0", plant.tyre.damping, "Ns/m"),
    ]


def curves(test: Trial) -> dict[str, Array]:
    """What is drawn of a test, every SHOWN-th tick, in mm, N and s."""
    shown = slice(None, None, SHOWN)
    found = {
        "time": test.time,
        "ground": 1e3 * test.ran.commands[:, 0],
        "asked position": 1e3 * test.ran.commands[:, 1],
        "asked force": test.ran.commands[:, 2],
        "plate": 1e3 * test.plate,
        "travel": 1e3 * test.travel,
        "wheel": 1e3 * test.wheel,
        "force": test.force,
        "ideal plate": 1e3 * test.should.structure,
        "ideal travel": 1e3 * (test.should.structure - test.should.wheel),
        "ideal wheel": 1e3 * test.should.wheel,
        "ideal force": test.should.force,
    }
    return {name: values[shown] for name, values in found.items()}


def seeded(names: Mapping[str, Callable[[int], Result]], seeds: int) -> dict[str, Job]:
    """A job for each name and seed, its key `name/seed`."""
    return {
        f"{name}/{seed}": (lambda work=work, seed=seed: work(seed))
        for name, work in names.items()
        for seed in range(seeds)
    }


def over_seeds(results: Mapping[str, Result], name: str, value: str) -> Array:
    """One value of every seed's result, shape (seeds,)."""
    keys = [key for key in results if key.rpartition("/")[0] == name]
    return np.array(
        [
            float(results[key][value])
            for key in sorted(keys, key=lambda key: int(key.rpartition("/")[2]))
        ]
    )
