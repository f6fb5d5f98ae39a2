"""A described machine in a session: its controller, its limits and its stop state."""

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
"""s for which the sensors are looked at before there is power."""
MISSED = 3.0
"""Ticks that may be missed in a row."""
COURSE = Course(LOOKING, armed=0.0, ramp=0.0, settling=0.0, hold=0.0)
"""Its controller takes over at once, since a machine that has power and no controller falls; for
the same reason power goes with the controller, and brakes hold."""


class MachineOperation:
    """An `Operation` of a described machine.

    Limits are those of the description; there is no ramp.
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
        """demands: of each channel that is given ahead, shape (ticks,); outputs, command: actuators
        that a controller commands, and that controller; stuck: the same readings in a row that end
        the test, 0 for any."""
        self.signals, self.period = signals, configuration.timing.period
        self.ticks = len(next(iter(demands.values()))) if demands else configuration.ticks
        self._command, self._outputs, self._stuck = command, list(outputs), stuck
        self._fields = [machine.components[name].channel or ("", name) for name in outputs]
        self._given = {channel: signal.tolist() for channel, signal in demands.items()}
        written = [signal.channel for signal in signals.outputs]
        self._channels = [*written, *(c for c in demands if c not in written)]
        names = [s.name for s in (*signals.inputs, *signals.outputs)]
        self._reach = [(s, *reach_of(configuration, s.name)) for s in signals.inputs]
        self._bounds = [(s, *reach_of(configuration, s.name)) for s in signals.outputs]
        self.watched = tuple(names)
        nothing = [min(max(0.0, low), high) for _, low, high in self._bounds]
        self.rest: tuple[float, ...] = (*nothing, *[0.0] * (len(self._channels) - len(nothing)))
        self.target = self.rest
        self._before: list[float] = [math.nan] * len(signals.inputs)
        self._repeats = [1] * len(signals.inputs)

    def look(self, measured: tuple[float, ...]) -> str | None:
        for (signal, low, high), value in zip(self._reach, measured, strict=True):
            if not low <= value <= high:
                return (
                    f"{signal.name} is {value:.4g} {signal.unit}; "
                    f"its limits are {low:g} and {high:g}"
                )
        return None

    def control(self, tick: int, measured: tuple[float, ...]) -> tuple[float, ...]:
        found = {channel: signal[tick] for channel, signal in self._given.items()}
        if self._command is not None:
            names = [signal.name for signal in self.signals.inputs]
            sensed = dict(zip(names, measured, strict=True))
            told = commands_of(self._command(tick, sensed), [field for _, field in self._fields])
            found |= dict(zip(self._fields, told, strict=True))
        return tuple(found[channel] for channel in self._channels)

    def judge_measured(
        self,
        measured: tuple[float, ...],
        interval: float,  # noqa: ARG002
    ) -> Cause | None:
        for place, (signal, low, high) in enumerate(self._reach):
            value = measured[place]
            if not math.isfinite(value):
                return Cause("not_a_number", f"trip: {signal.name} is not a finite number")
            if self._stuck:
                same = value == self._before[place]
                self._repeats[place] = self._repeats[place] + 1 if same else 1
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
        for (signal, low, high), value in zip(self._bounds, commands, strict=False):
            if not math.isfinite(value):
                return Cause("not_a_number", f"trip: {signal.name} is not a finite number")
            if not low <= value <= high:
                return _beyond(signal.name, value, low, high, signal.unit)
        return None

    def stop_state(self, held: tuple[float, ...]) -> tuple[float, ...]:
        safe = self.signals.stop_state(self.signals.to_write(held))
        return (*safe, *held[len(safe) :])

    def holds_after(self, cause: Cause) -> bool:  # noqa: ARG002
        return False

    def may_be_held(self, measured: tuple[float, ...]) -> bool:  # noqa: ARG002
        return False

    def watch(self, measured: tuple[float, ...], commands: tuple[float, ...]) -> tuple[float, ...]:
        return (*measured, *self.signals.to_write(commands))


def _beyond(name: str, value: float, low: float, high: float, unit: str) -> Cause:
    said = f"above {high:g}" if value > high else f"below {low:g}"
    return Cause("limit", f"trip: {name} {said} {unit}")
