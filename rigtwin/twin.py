"""The twin as a rig: MuJoCo's mechanics, both cylinders, and the converters in between."""

from __future__ import annotations

import numpy as np

from controllers import Commands, Measurements
from rigtwin.arrays import Array
from rigtwin.compiling import kernel
from rigtwin.configuration import Configuration
from rigtwin.converters import Disturbance, resolutions, sampled
from rigtwin.plant import Machine, Simulation, advance, sense

_advance = kernel(advance)


@kernel
def _sense(machine: Machine, ground_command: float, structure_command: float, out: Array) -> None:
    true = sense(machine, ground_command, structure_command)
    for number in range(4):
        out[number] = true[number]


class Twin:
    """A simulated rig. The same configuration, first ground command and seed give the same measurements to the bit.

    `truth` holds the last measurements before noise and quantisation.
    """

    def __init__(self, configuration: Configuration, ground: float, seed: int) -> None:
        """ground: the first ground command, m. Raises RigtwinError unless the period is a multiple of the timestep."""
        controller = configuration.controller
        self.simulation = Simulation(
            configuration.plant,
            configuration.timing.timestep,
            configuration.substeps,
            ground=ground,
            structure=controller.start,
            preload=controller.preload,
        )
        self.disturbance = Disturbance(configuration.plant, configuration.timing.period, seed)
        self.resolution = resolutions(configuration.plant)
        self.held = Commands(float(ground), controller.start, controller.preload, 0.0)
        self.truth = Measurements(0.0, 0.0, 0.0, 0.0)

    def start(self) -> None:
        """Nothing to do: a twin is built at its start."""

    def read(self) -> Measurements:
        true = np.empty(4)
        _sense(self.simulation.machine, self.held.ground, self.held.structure, true)
        self.truth = Measurements(*true.tolist())
        return sampled(self.truth, self.disturbance.take(1)[0], self.resolution)

    def write(self, commands: Commands) -> None:
        _advance(self.simulation.machine, commands.ground, commands.structure, commands.voltage)
        self.held = commands

    def stop(self) -> None:
        """Nothing to do: nothing moves unless written to."""
