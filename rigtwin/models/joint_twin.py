"""Twin of a single joint with prescribed motion: sensor readings of a test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.models.inputs import inputs_of_test
from rigtwin.models.inverse_twin import SimulatedSignals
from rigtwin.models.joint import PLACES
from rigtwin.models.joint_simulation import JointSimulation
from rigtwin.models.reading import sensors_of
from rigtwin.numerics.arrays import Array, has_diverged


def simulate_joint(
    machine: Machine, replay: ReplayOf, configuration: Configuration, demands: dict[str, Array]
) -> SimulatedSignals:
    """Simulate a test of a joint with prescribed motion that acts on no other joint.

    Parameters
    ----------
    machine
        Description of the machine.
    replay
        Replay of the joint.
    configuration
        Settings of the test, with the effects applied.
    demands
        Position sensor or position actuator of the joint → position or command, m or rad, shape
        (ticks,).

    Returns
    -------
    SimulatedSignals
        Readings of all sensors of the joint, without noise and quantisation.
    """
    plant, period, components = configuration.plant, configuration.timing.period, machine.components
    (mover,) = replay.moved_by
    rows = []
    for name in sensors_of(machine):
        known = components[name]
        if known.joint == replay.joint.name and known.channel is not None:
            rows.append(Row(name, known.quantity, known.channel, known.unit))
    no_signal = {row.name: np.zeros(len(demands[mover])) for row in rows}
    inputs = inputs_of_test(machine, {**no_signal, **demands}, period)
    observed = replace(replay, rows=tuple(rows))
    joint = JointSimulation(machine, observed, inputs, configuration, configuration.substeps)
    if components[mover].quantity:
        moved = joint.prescribe(plant, demands[mover])
    else:
        moved = joint.move(plant)
    readings = {
        row.name: apply_sensor(sensor_of(plant, row.name), moved[PLACES[row.kind]], period)
        for row in rows
    }
    return SimulatedSignals(readings, not has_diverged(moved))
