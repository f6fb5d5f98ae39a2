"""A twin behind the converters of a channel table, without a card in between."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rigtwin.hardware.daq.conversion import conversion, to_values, to_volts
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.realtime import Pacer
from rigtwin.numerics.arrays import Array


class Wired(Protocol):
    """Interface of a rig at a card's terminals. `volts` are the inputs now, shape (inputs,)."""

    @property
    def volts(self) -> Array: ...

    def advance(self, written: Array, power: bool) -> None:
        """Advance by one period under held output voltages, shape (outputs,), and the power."""
        ...


class WiredTwin:
    """A `DrivenRig`: a twin behind the converters of a channel table."""

    def __init__(self, terminals: Wired, table: ChannelTable) -> None:
        self._terminals, self._signals, self.missed = terminals, table.signals, 0
        self._inputs, self._outputs = conversion(table.inputs), conversion(table.outputs)
        count = len(table.outputs)
        self._values, self._commands = np.empty(len(table.inputs)), np.zeros(count)
        # Before the first read the twin has not moved, and its sample is still fresh.
        self._held, self._power, self._fresh = np.zeros(count), False, True

    def start(self) -> None:
        """Do nothing: a twin is ready when it is built."""

    def read(self) -> tuple[float, ...]:
        """Advance by one period, and return the sample. The first call does not advance."""
        if not self._fresh:
            self._terminals.advance(self._held, self._power)
        self._fresh = False
        to_values(self._inputs, self._terminals.volts, self._values)
        return self._signals.sample(*self._values.tolist())

    def write(self, commands: tuple[float, ...]) -> None:
        self._commands[:] = self._signals.to_write(commands)
        to_volts(self._outputs, self._commands, self._held)

    def power(self, on: bool) -> None:
        self._power = on

    def stop(self) -> None:
        """Set forces to zero, and switch the power off."""
        self._commands[:] = 0.0
        to_volts(self._outputs, self._commands, self._commands)
        # Positions keep their last voltage: a cylinder that jumped to zero would be no safe
        # state.
        places = self._signals.released_places
        self._held[places], self._power = self._commands[places], False


class InRealTime:
    """A `DrivenRig` that reads a twin in real time."""

    def __init__(self, rig: WiredTwin, period: float) -> None:
        self._rig, self._pacer, self.missed, self.late = rig, Pacer(period), 0, 0.0

    def start(self) -> None:
        self._rig.start()

    def read(self) -> tuple[float, ...]:
        self.missed, self.late = self._pacer.wait(), self._pacer.late
        # Time passes for the twin in missed ticks too: those samples are read and dropped.
        for _ in range(self.missed):
            self._rig.read()
        return self._rig.read()

    def write(self, commands: tuple[float, ...]) -> None:
        self._rig.write(commands)

    def power(self, on: bool) -> None:
        self._rig.power(on)

    def stop(self) -> None:
        self._rig.stop()
