"""Twin of coupled joints with prescribed motion: sensor readings of a test, by inverse dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.models.inputs import inputs_of_test
from rigtwin.models.inverse_dynamics import InverseDynamicsModel
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class SimulatedSignals:
    """Signals of a simulated test of one part of a machine.

    Attributes
    ----------
    signals : mapping of str to Array
        Component → reading or command, shape (ticks,).
    sound : bool
        Whether the motion stayed bounded.
    whole : frozenset of str
        Components whose signals already contain noise and quantisation.
    """

    signals: Mapping[str, Array]
    sound: bool
    whole: frozenset[str] = frozenset()


def simulate_prescribed(
    machine: Machine, configuration: Configuration, motions: dict[str, Array]
) -> SimulatedSignals:
    """Simulate a test of joints that all move as prescribed.

    Parameters
    ----------
    machine
        Description of the machine.
    configuration
        Settings of the test, with the effects applied.
    motions
        Sensor of a joint's motion → position of that joint, rad or m, shape (ticks,).

    Returns
    -------
    SimulatedSignals
        Readings of the motions' sensors and of the observed forces, without noise and quantisation.
    """
    (replay,) = machine.replays
    plant, period = configuration.plant, configuration.timing.period
    readings = {
        name: apply_sensor(sensor_of(plant, name), motion, period)
        for name, motion in motions.items()
    }
    inputs = inputs_of_test(machine, readings, period)
    # The model smooths these readings, as a diagnosis of the recording will.
    forces = InverseDynamicsModel(machine, replay, inputs).predict_true(plant)
    for row, force in zip(replay.rows, forces, strict=True):
        readings[row.name] = apply_sensor(sensor_of(plant, row.name), force, period)
    return SimulatedSignals(readings, True)
