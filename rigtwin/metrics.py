"""How well a test emulates what it should: the ideal system beside the model's output and what was sensed.

e1 = ideal − model output (numerical model error), e2 = model output − sensed (tracking error); thesis Eq. 3.1, 3.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from controllers import Skyhook, Travel
from rigtwin.arrays import Array
from rigtwin.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.noise import rms
from rigtwin.recording import Recording


@dataclass(frozen=True)
class Ideal:
    """The emulated system without any rig: sprung and wheel position m, suspension force N; shape (ticks,)."""

    structure: Array
    wheel: Array
    force: Array


@dataclass(frozen=True)
class Tracking:
    """rms errors of the structure (position, m) and the suspension (force, N); total is of e1 + e2 at every tick."""

    position_e1: float
    position_e2: float
    position_total: float
    force_e1: float
    force_e2: float
    force_total: float


def ideal(configuration: Configuration, ground: Array) -> Ideal:
    """The linear system that a passive or active test emulates: a single mass on the ground, or a quarter car on its tyre
    (no friction, no noise, no delay). Starts as the rig does. ground: m, held over each tick.

    Raises RigtwinError for semi-active skyhook, which is not linear.
    """
    settings, plant = configuration.controller, configuration.plant
    if settings.skyhook == Skyhook.SEMI_ACTIVE:
        raise RigtwinError("the ideal response of a semi-active suspension is not linear")
    sky = settings.skyhook_damping if settings.skyhook == Skyhook.ACTIVE else 0.0
    k, b, m = settings.suspension_stiffness, settings.suspension_damping, settings.sprung_mass
    gravity = np.ones_like(ground)
    if settings.travel == Travel.GROUND:
        # States: sprung position relative to the ground z, and its absolute velocity v. ż = v − u̇, so z + u is used: x.
        # A held ground has no rate between ticks; the damper sees the difference over the tick before.
        rate = np.diff(ground, prepend=ground[0]) / configuration.timing.period
        a = np.array([[0.0, 1.0], [-k / m, -(b + sky) / m]])
        inputs = np.column_stack([ground, rate, gravity])
        entry = np.array([[0.0, 0.0, 0.0], [k / m, b / m, settings.preload / m - settings.gravity]])
        states = _simulated(a, entry, inputs, np.array([settings.start, 0.0]), configuration.timing.period)
        force = settings.preload - k * (states[:, 0] - ground) - b * (states[:, 1] - rate) - sky * states[:, 1]
        return Ideal(states[:, 0], ground, force)
    kt, mu = plant.tyre.stiffness, plant.carriage.mass
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-k / m, -(b + sky) / m, k / m, b / m],
            [0.0, 0.0, 0.0, 1.0],
            [k / mu, (b + sky) / mu, -(k + kt) / mu, -b / mu],
        ]
    )
    entry = np.array(
        [[0.0, 0.0], [0.0, settings.preload / m - settings.gravity], [0.0, 0.0], [kt / mu, -settings.preload / mu]]
    )
    start = np.array([settings.start, 0.0, float(ground[0]) - settings.preload / kt, 0.0])
    states = _simulated(a, entry, np.column_stack([ground, gravity]), start, configuration.timing.period)
    travel, rate = states[:, 0] - states[:, 2], states[:, 1] - states[:, 3]
    return Ideal(states[:, 0], states[:, 2], settings.preload - k * travel - b * rate - sky * states[:, 1])


def _simulated(a: Array, entry: Array, inputs: Array, start: Array, period: float) -> Array:
    """States at every tick under inputs held over each; exact."""
    count = len(a)
    both = np.zeros((count + entry.shape[1],) * 2)
    both[:count, :count], both[:count, count:] = a, entry
    sampled = expm(both * period)
    transition, step = sampled[:count, :count], sampled[:count, count:]
    states = np.empty((len(inputs), count))
    states[0] = start
    for tick in range(1, len(inputs)):
        states[tick] = transition @ states[tick - 1] + step @ inputs[tick - 1]
    return states


def tracking(recording: Recording, configuration: Configuration) -> Tracking:
    """e1 and e2 of a model-in-the-loop test. What was sensed is without noise where a twin knows it."""
    target = ideal(configuration, recording.column("/command", "ground"))
    known = "/truth" in recording.columns
    structure = recording.column("/truth", "structure") if known else recording.column("/sensor", "structure_lvdt")
    load_cell = recording.column("/truth" if known else "/sensor", "load_cell")
    position, force = recording.column("/command", "structure"), recording.column("/command", "force")
    return Tracking(
        position_e1=rms(target.structure - position),
        position_e2=rms(position - structure),
        position_total=rms(target.structure - structure),
        force_e1=rms(target.force - force),
        force_e2=rms(force - load_cell),
        force_total=rms(target.force - load_cell),
    )
