"""Imposed tests: the force and both plate motions follow multisines.

No model closes the loop, so the rig cannot diverge, and every component is excited.
"""

from __future__ import annotations

import numpy as np

from controllers import Mode, Settings
from experiments.experiment import random_of, time_of
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import multisine
from rigtwin.simulation.experiment import Experiment

FORCE_MEAN = 230.0
"""Mean force, N. It keeps the tyre pressed to the ground while the force swings."""


def multisines(configuration: Configuration, seed: int) -> Array:
    """Return the demands of the test `imposed`, shape (ticks, 3): ground m, structure m, force N.

    Ground and structure have amplitudes ∝ 1/f over 0.2 to 10 Hz, with 5 and 9 mm rms. The force
    has amplitudes ∝ 1/√f over 0.3 to 30 Hz, with 35 N rms about its mean.
    """
    # Displacements ∝ 1/f have the same speed at every frequency, so the high frequencies alone do
    # not use up the cylinders' speed limit.
    time, random = time_of(configuration), random_of(seed)
    ground = multisine(time, 0.2, 10.0, 0.1, 1.0, 0.005, random)
    # About the start position, where the test is ramped to; the ground starts at zero.
    structure = configuration.controller.start + multisine(time, 0.2, 10.0, 0.1, 1.0, 0.009, random)
    force = FORCE_MEAN + multisine(time, 0.3, 30.0, 0.1, 0.5, 35.0, random)
    return np.column_stack([ground, structure, force])


def fast_multisines(configuration: Configuration, seed: int) -> Array:
    """Return the demands of the test `imposed-fast`, shape (ticks, 3): ground m, structure m, N.

    The motions are about half as large as in `imposed`. The force extends over 0.5 to 120 Hz,
    flat above 20 Hz, with 50 N rms.
    """
    time, random = time_of(configuration), random_of(seed)
    ground = multisine(time, 0.2, 10.0, 0.1, 0.5, 0.0025, random)
    structure = configuration.controller.start + multisine(time, 0.2, 20.0, 0.1, 0.5, 0.004, random)
    # A delay and a lag of equal low-frequency phase differ only well above the loop's bandwidth,
    # so the force is flat up to 120 Hz. The two bands add in power: √(20² + 45²) ≈ 50 N rms.
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
