"""A controller in the loop of a twin that goes from tick to tick: what its sensors read, and what
it commands by that."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from controllers.formula import run
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import start_transducer, transduce, transducer
from rigtwin.description.control import Channel, FormulaControl
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

Tick = Callable[[Mapping[str, float], Mapping[str, float]], "float | Mapping[str, float]"]
"""A controller's command, or commands by name, for what its sensors read and for what is demanded,
both by name."""
Command = Callable[[int, Mapping[str, float]], "float | Mapping[str, float]"]
"""The same for a tick's number and what the sensors read."""
Columns = Mapping[str, Mapping[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


@kernel
def _evaluate(operations: np.ndarray, registers: Array, memory: Array, period: float) -> float:
    """A formula's value at a tick; see `controllers.formula.run`."""
    return run(operations, registers, memory, period)


class Readings:
    """What sensors read, one tick after another, with their noise and bits.

    Parameters
    ----------
    plant
        Its components.
    names
        Of the sensors.
    noise
        Sensor → what is added to its reading, shape (ticks,); none by default.
    period
        s, of a tick.
    ticks
        Of the test.
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
        """Sensor → what it read so far, shape (ticks,)."""
        self._noise = noise
        self._bits = {name: getattr(plant, name).resolution for name in names}
        self._models = {name: transducer(getattr(plant, name), period) for name in names}
        self._states = {name: start_transducer(each) for name, each in self._models.items()}

    def take(self, tick: int, true: Mapping[str, float]) -> dict[str, float]:
        """Sensor → reading. true: of each, what an ideal one would read."""
        found = {}
        for name, model in self._models.items():
            value = transduce(model, self._states[name], true[name])
            if name in self._noise:
                value += float(self._noise[name][tick])
            bit = self._bits[name]
            found[name] = self.signals[name][tick] = round(value / bit) * bit if bit else value
        return found


def commands_of(found: object, names: Sequence[str]) -> list[float]:
    """The commands that a controller gave, one a name.

    Raises RigtwinError for anything but a finite number for each.
    """
    given: Mapping[str, Any] = found if isinstance(found, Mapping) else dict.fromkeys(names, found)
    if (isinstance(found, Mapping) or len(names) == 1) and set(given) == set(names):
        try:
            commands = [float(given[name]) for name in names]
        except (TypeError, ValueError, OverflowError):
            commands = [math.nan]
        if all(map(math.isfinite, commands)):
            return commands
    expected = f"expected {{{', '.join(f'{name!r}: number' for name in names)}}}"
    or_one = "expected a finite number" if len(names) == 1 else expected
    raise RigtwinError(f"the controller gave {found!r:.60}; {or_one}")


def command_by_function(own: Tick, columns: Columns) -> Command:
    """A controller of one's own. columns: with what is demanded, under /command."""
    demanded = columns.get("/command", {})

    def command(tick: int, sensed: Mapping[str, float]) -> float | Mapping[str, float]:
        return own(sensed, {name: float(signal[tick]) for name, signal in demanded.items()})

    return command


def command_by_formula(
    control: FormulaControl,
    settings: Mapping[str, float],
    columns: Columns,
    sensors: Mapping[Channel, str],
    period: float,
) -> Command:
    """The controller of a description.

    Parameters
    ----------
    control
        The formula.
    settings
        Its numbers.
    columns
        With what it reads besides sensors.
    sensors
        Channel → sensor.
    period
        s, of a tick.
    """
    program = control.program(settings)
    operations = np.ascontiguousarray(program.operations)
    registers, memory = program.registers.copy(), control.formula.memory()
    # Compiled before it is needed: a tick has no time for that.
    _evaluate(operations, registers.copy(), memory.copy(), period)
    given = [
        None if channel in sensors else columns[channel[0]][channel[1]]
        for channel in control.channels
    ]
    read = [sensors.get(channel, "") for channel in control.channels]

    def command(tick: int, sensed: Mapping[str, float]) -> float:
        for number, signal in enumerate(given):
            registers[number] = sensed[read[number]] if signal is None else signal[tick]
        return float(_evaluate(operations, registers, memory, period))

    return command
