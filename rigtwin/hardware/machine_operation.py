"""Operation of a described machine: its controller, its limits and its stop state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.hardware.daq.signals import Signals, reach_of
from rigtwin.hardware.operation import Course
from rigtwin.hardware.supervisor import Cause
from rigtwin.models.commanding import Command, commands_of
from rigtwin.numerics.arrays import Array

LOOKING = 0.3
"""Time during which sensors are checked before power, in s."""
MISSED = 3.0
"""Maximum number of ticks missed in a row."""
COURSE = Course(LOOKING, armed=0.0, ramp=0.0, settling=0.0, hold=0.0)
"""Course of a session. The controller takes over at once, because a machine with power but without
a controller would fall. For the same reason power ends with the controller, and brakes hold."""


class MachineOperation:
    """An `Operation` of a described machine.

    Limits are those of the description. There is no ramp.
    """

    course, missed = COURSE, MISSED

    def __init__(
        self,
        machine: Machine,
        configuration: Configuration,
        signals: Signals,
        demands: Mapping[tuple[str, str], Array],
        outputs: Sequence[str],
        command: Command | None,
        stuck: float,
    ) -> None:
        """Prepare a test of a machine.

        Parameters
        ----------
        machine, configuration
            Machine under test, and its settings.
        signals
            Signals on the card.
        demands
            Demand of each channel that is known in advance, shape (ticks,).
        outputs, command
            Actuators that a controller commands, and the controller; None without one.
        stuck
            Number of equal readings in a row that ends the test; 0 for no limit.
        """
        self.signals, self.period = signals, configuration.timing.period
        self.ticks = len(next(iter(demands.values()))) if demands else configuration.ticks
        self._command, self._outputs, self._stuck = command, list(outputs), stuck
        self._fields = [machine.components[name].channel or ("", name) for name in outputs]
        self._planned = {channel: signal.tolist() for channel, signal in demands.items()}
        written = [signal.channel for signal in signals.outputs]
        self._channels = [*written, *(c for c in demands if c not in written)]
        names = [s.name for s in (*signals.inputs, *signals.outputs)]
        self._reach = [(s, *reach_of(configuration, s.name)) for s in signals.inputs]
        self._bounds = [(s, *reach_of(configuration, s.name)) for s in signals.outputs]
        self.watched = tuple(names)
        # At rest an output is zero, or as near to it as its limits allow.
        zeros = [min(max(0.0, low), high) for _, low, high in self._bounds]
        self.rest: tuple[float, ...] = (*zeros, *[0.0] * (len(self._channels) - len(zeros)))
        self.target = self.rest
        self._before: list[float] = [math.nan] * len(signals.inputs)
        self._repeats = [1] * len(signals.inputs)

    def look(self, measured: tuple[float, ...]) -> str | None:
        """Return the first limit that the sensors exceed, in words, or None."""
        for (signal, low, high), value in zip(self._reach, measured, strict=True):
            if not low <= value <= high:
                return (
                    f"{signal.name} is {value:.4g} {signal.unit}; "
                    f"its limits are {low:g} and {high:g}"
                )
        return None

    def control(self, tick: int, measured: tuple[float, ...]) -> tuple[float, ...]:
        """Return all demands of a tick: those known in advance, and the controller's commands."""
        values = {channel: signal[tick] for channel, signal in self._planned.items()}
        if self._command is not None:
            names = [signal.name for signal in self.signals.inputs]
            sensed = dict(zip(names, measured, strict=True))
            fields = [field for _, field in self._fields]
            commands = commands_of(self._command(tick, sensed), fields)
            values |= dict(zip(self._fields, commands, strict=True))
        return tuple(values[channel] for channel in self._channels)

    def judge_measured(
        self,
        measured: tuple[float, ...],
        interval: float,  # noqa: ARG002
    ) -> Cause | None:
        # NaN is checked before the limits, because every comparison with it is false.
        for place, (signal, low, high) in enumerate(self._reach):
            value = measured[place]
            if not math.isfinite(value):
                return Cause("not_a_number", f"trip: {signal.name} is not a finite number")
            # Equal readings are normal for a quantised sensor at rest, so the check is optional.
            if self._stuck:
                repeated = value == self._before[place]
                self._repeats[place] = self._repeats[place] + 1 if repeated else 1
                self._before[place] = value
                if self._repeats[place] >= self._stuck:
                    return Cause(
                        "stuck",
                        f"trip: {signal.name} gave {self._stuck:g} times the same reading: "
                        "sensor stuck or cable off",
                    )
            if not low <= value <= high:
                return _beyond(signal.name, value, low, high, signal.unit)
        return None

    def judge_commands(
        self,
        measured: tuple[float, ...],  # noqa: ARG002
        commands: tuple[float, ...],
        interval: float,  # noqa: ARG002
    ) -> Cause | None:
        # Outputs come first. Demands behind them are only recorded, and have no limits.
        for (signal, low, high), value in zip(self._bounds, commands, strict=False):
            if not math.isfinite(value):
                return Cause("not_a_number", f"trip: {signal.name} is not a finite number")
            if not low <= value <= high:
                return _beyond(signal.name, value, low, high, signal.unit)
        return None

    def stop_state(self, held: tuple[float, ...]) -> tuple[float, ...]:
        """Return safe commands: forces zero, positions held, other demands unchanged."""
        safe = self.signals.stop_state(self.signals.to_write(held))
        return (*safe, *held[len(safe) :])

    def holds_after(self, cause: Cause) -> bool:  # noqa: ARG002
        return False

    def may_be_held(self, measured: tuple[float, ...]) -> bool:  # noqa: ARG002
        return False

    def watch(self, measured: tuple[float, ...], commands: tuple[float, ...]) -> tuple[float, ...]:
        return (*measured, *self.signals.to_write(commands))


def _beyond(name: str, value: float, low: float, high: float, unit: str) -> Cause:
    """Return the cause of a limit that is exceeded."""
    said = f"above {high:g}" if value > high else f"below {low:g}"
    return Cause("limit", f"trip: {name} {said} {unit}")
