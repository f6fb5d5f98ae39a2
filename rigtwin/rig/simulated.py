"""Recordings that a test of the suspension rig would make."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controllers import Commands, Measurements
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.simulation.runner import simulate, without_limits


def simulate_recording(
    machine: str, name: str, configuration: Configuration, demands: Array, seed: int
) -> RecordedTest:
    """Return the recording that a test would make if no limit ended it.

    Parameters
    ----------
    machine, name
        Names of machine and test.
    configuration
        Settings of the test.
    demands
        Columns of `controllers.Demand`, shape (ticks, 3).
    seed
        Seed of the sensor noise.
    """
    ran = simulate(without_limits(configuration), demands, seed)
    period = configuration.timing.period
    return RecordedTest(
        path=Path(name),
        machine=machine,
        experiment=name,
        period=period,
        time=np.arange(len(ran.commands)) * period,
        columns={
            "/command": dict(zip(Commands._fields, ran.commands.T.copy(), strict=True)),
            "/sensor": dict(zip(Measurements._fields, ran.measurements.T.copy(), strict=True)),
        },
        controller=flatten(configuration)["controller"],
    )
