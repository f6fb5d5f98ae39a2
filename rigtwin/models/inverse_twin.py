"""The twin of joints that act on each other: what their sensors read while a test moves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.models.inputs import inputs_of_test
from rigtwin.models.inverse_dynamics import InverseDynamicsModel
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class SimulatedSignals:
    """What a twin did. signals: component → reading or command, shape (ticks,); sound: whether all
    motions stayed within what a machine can do; whole: of which signals noise and bits are
    part."""

    signals: Mapping[str, Array]
    sound: bool
    whole: frozenset[str] = frozenset()


def simulate_prescribed(
    machine: Machine, configuration: Configuration, motions: dict[str, Array]
) -> SimulatedSignals:
    """What the sensors read, noise and bits apart.

    Parameters
    ----------
    machine
        Its description.
    configuration
        With the effects that it has.
    motions
        Component that senses a joint's motion → where that joint goes, rad or m, shape (ticks,).

    Returns
    -------
    SimulatedSignals
        What the motions' sensors read, and those of the observed forces.
    """
    (replay,) = machine.replays
    plant, period = configuration.plant, configuration.timing.period
    found = {
        name: apply_sensor(getattr(plant, name), motion, period) for name, motion in motions.items()
    }
    inputs = inputs_of_test(machine, found, period)
    forces = InverseDynamicsModel(machine, replay, inputs).predict_true(plant)
    for row, force in zip(replay.rows, forces, strict=True):
        found[row.name] = apply_sensor(getattr(plant, row.name), force, period)
    return SimulatedSignals(found, True)
