"""Twin of the suspension rig as a `Rig`: mechanics in MuJoCo, both cylinders and converters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controllers import Commands, Measurements
from controllers.force import MOTOR_CONSTANT
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.converters import Disturbance, build_sensing, sample_sensors
from rigtwin.simulation.plant import PlantState, Simulation, advance, continue_motion, sense

_advance = kernel(advance)


@kernel
def _sense(plant: PlantState, out: Array) -> None:
    true = sense(plant)
    for number in range(4):
        out[number] = true[number]


class Twin:
    """Simulated rig.

    The same configuration, first ground command and seed give the same measurements to the bit.
    `truth` holds the last readings of ideal sensors.

    Parameters
    ----------
    configuration
        Settings of the test.
    ground
        First ground command, m.
    seed
        Seed of the sensors' noise and of missed ticks.

    Raises
    ------
    RigtwinError
        If the period is not a multiple of the timestep.
    """

    def __init__(self, configuration: Configuration, ground: float, seed: int) -> None:
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
        self.sensing = build_sensing(configuration.plant, configuration.timing.period)
        # An independent random stream: missed ticks do not change the noise.
        self._missed = np.random.default_rng([seed, 2])
        self._share_missed = configuration.plant.computer.missed_ticks
        self.held = Commands(
            float(ground), controller.start, controller.preload, controller.preload / MOTOR_CONSTANT
        )
        self.truth = Measurements(0.0, 0.0, 0.0, 0.0)

    def change(self, configuration: Configuration) -> None:
        """Continue the test with another plant.

        The motion and the streams of noise continue. The conditioning of commands begins as if the
        present ones had been held for long.
        """
        plant, before = configuration.plant, self.simulation
        self.simulation = Simulation(
            plant,
            configuration.timing.timestep,
            configuration.substeps,
            ground=self.held.ground,
            structure=self.held.structure,
            preload=self.held.voltage * plant.motor.constant,
        )
        continue_motion(before, self.simulation)
        sensing = build_sensing(plant, configuration.timing.period)
        for old_state, new_state in zip(self.sensing.states, sensing.states, strict=True):
            for old, new in zip(old_state, new_state, strict=True):
                if old.shape == new.shape:
                    new[:] = old
        self.sensing = sensing
        self.disturbance.change(plant)
        self._share_missed = plant.computer.missed_ticks

    def start(self) -> None:
        """Do nothing: a twin is built at its start."""

    def read(self) -> Measurements:
        true = np.empty(4)
        _sense(self.simulation.state, true)
        self.truth = Measurements(*true.tolist())
        return sample_sensors(self.sensing, self.truth, self.disturbance.take(1)[0])

    def misses(self, ticks: int) -> NDArray[np.bool_]:
        """Return which of the next ticks the computer misses, shape (ticks,).

        Its outputs keep their values at a missed tick.
        """
        return self._missed.random(ticks) < self._share_missed

    def write(self, commands: Commands) -> None:
        _advance(self.simulation.state, commands.ground, commands.structure, commands.voltage)
        self.held = commands

    def stop(self) -> None:
        """Do nothing: a twin does not move unless written to."""
