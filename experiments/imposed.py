"""Imposed tests: force and both motions follow multisines, so the rig cannot run away and
everything is excited."""

from __future__ import annotations

import numpy as np

from controllers import Mode, Settings
from experiments.experiment import random_of, time_of
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import multisine
from rigtwin.simulation.experiment import Experiment

FORCE_MEAN = 230.0
"""N; keeps the tyre pressed while the force swings."""


def multisines(configuration: Configuration, seed: int) -> Array:
    """Ground and structure ∝ 1/f over 0.2–10 Hz, 5 and 9 mm rms; force ∝ 1/√f over 0.3–30 Hz, 35 N
    rms about its mean."""
    time, random = time_of(configuration), random_of(seed)
    ground = multisine(time, 0.2, 10.0, 0.1, 1.0, 0.005, random)
    structure = configuration.controller.start + multisine(time, 0.2, 10.0, 0.1, 1.0, 0.009, random)
    force = FORCE_MEAN + multisine(time, 0.3, 30.0, 0.1, 0.5, 35.0, random)
    return np.column_stack([ground, structure, force])


def fast_multisines(configuration: Configuration, seed: int) -> Array:
    """Slow motions as in the imposed test at half its size, and force over 0.5–120 Hz, flat above
    20 Hz: 50 N rms."""
    time, random = time_of(configuration), random_of(seed)
    ground = multisine(time, 0.2, 10.0, 0.1, 0.5, 0.0025, random)
    structure = configuration.controller.start + multisine(time, 0.2, 20.0, 0.1, 0.5, 0.004, random)
    force = (
        FORCE_MEAN
        + multisine(time, 0.5, 20.0, 0.1, 0.5, 20.0, random)
        + multisine(time, 20.0, 120.0, 0.1, 0.0, 45.0, random)
    )
    return np.column_stack([ground, structure, force])


EXPERIMENTS = (
    Experiment(
        "imposed",
        "force and both motions imposed by multisines: excites every component",
        "for diagnosis",
        Configuration(controller=Settings(mode=Mode.IMPOSED)),
        multisines,
    ),
    Experiment(
        "imposed-fast",
        "imposed, with the force up to 120 Hz: tells a delay from a lag",
        "for diagnosis",
        Configuration(controller=Settings(mode=Mode.IMPOSED)),
        fast_multisines,
    ),
)
