"""A controller in the loop of a twin that advances tick by tick: its readings and its commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from controllers.formula_program import run
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of, start_transducer, transduce, transducer
from rigtwin.description.control import Channel, FormulaControl
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

Tick = Callable[[Mapping[str, float], Mapping[str, float]], "float | Mapping[str, float]"]
"""Controller of the user: readings by sensor, demands by name → one command, or commands by
name."""
Command = Callable[[int, Mapping[str, float]], "float | Mapping[str, float]"]
"""Controller in the loop: number of the tick, readings by sensor → one command, or commands by
name."""
Columns = Mapping[str, Mapping[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


@kernel
def _evaluate(operations: np.ndarray, registers: Array, memory: Array, period: float) -> float:
    """Return a formula's value at a tick; see `controllers.formula.run`."""
    return run(operations, registers, memory, period)


class Readings:
    """Readings of sensors, one tick after another, with noise and quantisation.

    Parameters
    ----------
    plant
        Components of the machine.
    names
        Names of the sensors.
    noise
        Sensor → noise added to its reading, shape (ticks,). Sensors without an entry have none.
    period
        Time from tick to tick, s.
    ticks
        Number of ticks of the test.
    """

    def __init__(
        self,
        plant: Plant,
        names: Sequence[str],
        noise: Mapping[str, Array],
        period: float,
        ticks: int,
    ) -> None:
        self.signals = {name: np.zeros(ticks) for name in names}
        """Sensor → readings up to the current tick, zero after it, shape (ticks,)."""
        self._noise = noise
        sensors = {name: sensor_of(plant, name) for name in names}
        self._bits = {name: sensor.resolution for name, sensor in sensors.items()}
        self._models = {name: transducer(sensor, period) for name, sensor in sensors.items()}
        self._states = {name: start_transducer(each) for name, each in self._models.items()}

    def take(self, tick: int, true: Mapping[str, float]) -> dict[str, float]:
        """Return the readings of a tick by sensor.

        Parameters
        ----------
        tick
            Number of the tick.
        true
            Sensor → reading of an ideal sensor.
        """
        readings = {}
        for name, model in self._models.items():
            value = transduce(model, self._states[name], true[name])
            if name in self._noise:
                # Noise before rounding, as in the recording: the controller acts on what is
                # recorded.
                value += float(self._noise[name][tick])
            bit = self._bits[name]
            readings[name] = self.signals[name][tick] = round(value / bit) * bit if bit else value
        return readings


def commands_of(answer: object, names: Sequence[str]) -> list[float]:
    """Return a controller's commands in the order of the actuators.

    Parameters
    ----------
    answer
        Answer of the controller: a number for a single actuator, or numbers by name.
    names
        Names of the commands.

    Returns
    -------
    list of float
        One command for each name.

    Raises
    ------
    RigtwinError
        If the answer is not exactly one finite number for each name.
    """
    by_name: Mapping[str, Any] = (
        answer if isinstance(answer, Mapping) else dict.fromkeys(names, answer)
    )
    if (isinstance(answer, Mapping) or len(names) == 1) and set(by_name) == set(names):
        try:
            commands = [float(by_name[name]) for name in names]
        except (TypeError, ValueError, OverflowError):
            commands = [math.nan]
        if all(map(math.isfinite, commands)):
            return commands
    expected = f"expected {{{', '.join(f'{name!r}: number' for name in names)}}}"
    or_one = "expected a finite number" if len(names) == 1 else expected
    raise RigtwinError(f"the controller gave {answer!r:.60}; {or_one}")


def command_by_function(controller: Tick, columns: Columns) -> Command:
    """Return a controller in the loop that calls the user's function.

    Parameters
    ----------
    controller
        Function of readings and demands, both by name.
    columns
        Signals of the test: topic → field → signal. Demands are under `/command`.
    """
    demanded = columns.get("/command", {})

    def command(tick: int, sensed: Mapping[str, float]) -> float | Mapping[str, float]:
        return controller(sensed, {name: float(signal[tick]) for name, signal in demanded.items()})

    return command


def command_by_formula(
    control: FormulaControl,
    settings: Mapping[str, float],
    columns: Columns,
    sensors: Mapping[Channel, str],
    period: float,
) -> Command:
    """Return a controller in the loop by the formula of a description.

    Parameters
    ----------
    control
        Formula of the controller.
    settings
        Values of its settings.
    columns
        Signals of the test: topic → field → signal, shape (ticks,).
    sensors
        Channel → sensor, for inputs that are simulated.
    period
        Time from tick to tick, s.

    Returns
    -------
    Command
        Function of the tick and the readings.
    """
    program = control.program(settings)
    operations = np.ascontiguousarray(program.operations)
    registers, memory = program.registers.copy(), control.formula.memory()
    # Compile before the test: a tick of 1 ms has no time for it. Copies keep the state clean.
    _evaluate(operations, registers.copy(), memory.copy(), period)
    recorded = [
        None if channel in sensors else columns[channel[0]][channel[1]]
        for channel in control.channels
    ]
    read = [sensors.get(channel, "") for channel in control.channels]

    def command(tick: int, sensed: Mapping[str, float]) -> float:
        for number, signal in enumerate(recorded):
            registers[number] = sensed[read[number]] if signal is None else signal[tick]
        return float(_evaluate(operations, registers, memory, period))

    return command
