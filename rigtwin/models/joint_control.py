"""Source of a pushed joint's command: the recording, or the described controller in closed loop."""

from __future__ import annotations

import numpy as np

from controllers.formula import formula
from rigtwin.components import PositionSensor
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of, start_transducer, transducer
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import FormulaControl
from rigtwin.description.machine import OWN, Machine
from rigtwin.description.replay import ReplayOf
from rigtwin.models.joint_motion import Loop
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs
from rigtwin.signals.noise import white_noise

NO_COMMAND = formula("0", {})


class JointControl:
    """Source of a pushed joint's command under the inputs of one recording.

    Parameters
    ----------
    machine, replay, inputs, configuration
        Machine, replay of the joint, recorded signals and settings, as in `Physics.model`.

    Attributes
    ----------
    closed : bool
        Whether the replay computes the command instead of taking the recorded one.
    sensors : tuple of str
        Sensors of the joint that the controller reads.

    Raises
    ------
    RigtwinError
        If an input of the controller is missing from the recording.
    """

    def __init__(
        self, machine: Machine, replay: ReplayOf, inputs: Inputs, configuration: Configuration
    ) -> None:
        # A controller of the user's own cannot be run along: its recorded commands are used.
        self.closed = replay.closed and OWN not in inputs.controller
        self._formula, self._program = NO_COMMAND, NO_COMMAND.program
        channels: tuple[tuple[str, str], ...] = ()
        if self.closed and isinstance(machine.control, FormulaControl):
            self._formula, channels = machine.control.formula, machine.control.channels
            self._program = machine.control.program(configuration.controller._asdict())
        sensors = {
            component.channel: component
            for component in machine.components.values()
            if component.joint == replay.joint.name
            and component.channel in channels
            and component.quantity in ("position", "velocity")
        }
        self.sensors = tuple(component.name for component in sensors.values())
        # At least one entry, as of the one sensor that stands in where the controller reads none.
        self._rates = np.array([int(c.quantity == "velocity") for c in sensors.values()] or [0])
        places = list(sensors)
        self._sensor_of_input = np.array(
            [places.index(each) if each in sensors else -1 for each in channels], np.int64
        )
        columns = [inputs.column(*channel) for channel in channels]
        # Numba needs arrays of two dimensions even where there is no input.
        self._recorded = np.column_stack(columns) if columns else np.zeros((1, 1))
        self._no_noise = np.zeros_like(self._recorded)

    @property
    def runs(self) -> bool:
        """Whether the described controller runs along."""
        return self._formula is not NO_COMMAND

    def loop(self, plant: Plant, period: float, noise: Array | None) -> Loop:
        """Return the source of the command before a test, as compiled code takes it.

        Parameters
        ----------
        plant
            Components of the machine.
        period
            Time from tick to tick, s.
        noise
            Noise of the controller's inputs, shape (ticks, inputs). Default: none.
        """
        parts = [sensor_of(plant, name) for name in self.sensors] or [PositionSensor()]
        sensors = tuple(transducer(part, period) for part in parts)
        return Loop(
            closed=self.runs,
            program=self._program,
            registers=self._program.registers.copy(),
            memory=self._formula.memory(),
            recorded=self._recorded,
            noise=self._no_noise if noise is None else noise,
            sensor_of_input=self._sensor_of_input,
            sensors=sensors,
            states=tuple(start_transducer(sensor) for sensor in sensors),
            neutral=np.array([sensor.neutral for sensor in sensors]),
            rates=self._rates,
        )

    def draw_noise(self, random: np.random.Generator) -> Array:
        """Return one draw of the noise of the controller's sensors, shape (ticks, inputs)."""
        ticks = len(self._recorded)
        noise = np.zeros_like(self._recorded)
        for number, place in enumerate(self._sensor_of_input):
            if place >= 0:
                column = np.ascontiguousarray(self._recorded[:, number])
                noise[:, number] = white_noise(column) * random.standard_normal(ticks)
        return noise
