"""Makes a card's outputs safe when the process that owned them is dead or hangs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from rigtwin.hardware.daq.card import (
    INPUTS,
    OUTPUTS,
    PRESSURE,
    CardFault,
    connect,
    translate_errors,
)
from rigtwin.hardware.daq.conversion import conversion, to_volts
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.numerics.arrays import Array


class LastResort:
    """Sets a card's outputs to their safe state in place of their owner.

    On a gRPC device server they are found by their name, which can be done beforehand.

    A driver on this computer gives them back when it sees that their owner is dead; then they are
    taken anew.
    """

    def __init__(self, table: ChannelTable) -> None:
        self._table, self._conversion = table, conversion(table.outputs)
        self._outputs: Any = None
        self._power: Any = None
        self._tasks: list[Any] = []
        count = len(table.outputs)
        self._values, self._volts = np.zeros(count), np.empty(count)
        to_volts(self._conversion, self._values, self._volts)  # compiled before it is needed

        connect(table.address)  # loads the driver's client, which takes a while

    def prepare(self) -> None:
        """Called once the owner has its outputs. Raises CardFault."""
        if self._table.address:
            with translate_errors(f"card {self._table.device}: watching it"):
                self._attach()

    def hold(self, outputs: Sequence[float] | Array) -> None:
        """Sets the outputs to the values that are safe now: no force, positions held.

        Raises CardFault.
        """
        self._values[:] = outputs
        to_volts(self._conversion, self._values, self._volts)
        with translate_errors(f"card {self._table.device}: stopping it"):
            if self._outputs is None:
                self._take()
            assert self._outputs is not None
            self._outputs.write_one_sample(self._volts)

    def power_off(self) -> None:
        """Raises CardFault."""
        with translate_errors(f"card {self._table.device}: taking its power off"):
            if self._power is None:
                self._take()
            assert self._power is not None
            self._power.write_one_sample_one_line(False)

    def close(self) -> None:
        """Gives the lines back."""
        for task in self._tasks:
            with suppress(Exception):
                task.stop()
            with suppress(Exception):
                task.close()
        self._tasks, self._outputs, self._power = [], None, None

    def _attach(self) -> None:
        from nidaqmx import Task
        from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior

        channel, attach = (
            connect(self._table.address),
            SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION,
        )
        assert channel is not None
        for name in (OUTPUTS, PRESSURE, INPUTS):
            options = GrpcSessionOptions(channel, name, initialization_behavior=attach)
            self._tasks.append(Task(name, grpc_options=options))
        self._open_writers(started=True)

    def _take(self) -> None:
        from nidaqmx import Task

        self.close()
        channel = connect(self._table.address)
        names = (f"{OUTPUTS}-again", f"{PRESSURE}-again")
        if channel is None:
            outputs, pressure = (Task(name) for name in names)
        else:
            from nidaqmx.grpc_session_options import GrpcSessionOptions

            outputs, pressure = (
                Task(name, grpc_options=GrpcSessionOptions(channel, name)) for name in names
            )
        self._tasks = [outputs, pressure]
        for line in self._table.outputs:
            volts = line.scaling.range
            outputs.ao_channels.add_ao_voltage_chan(
                self._table.physical(line.line), min_val=-volts, max_val=volts
            )
        pressure.do_channels.add_do_chan(self._table.physical(self._table.power))
        self._open_writers(started=False)

    def _open_writers(self, started: bool) -> None:
        from nidaqmx.stream_writers import AnalogMultiChannelWriter, DigitalSingleChannelWriter

        self._outputs = AnalogMultiChannelWriter(self._tasks[0].out_stream)
        self._power = DigitalSingleChannelWriter(self._tasks[1].out_stream)
        self._outputs.verify_array_shape = self._power.verify_array_shape = False
        self._outputs.auto_start = self._power.auto_start = not started


def release(table: ChannelTable) -> bool:
    """Frees what a program that died has left on a gRPC device server.

    Forces to zero, power off, its tasks ended. Returns whether there was anything. Raises
    CardFault if the outputs could not be set.
    """
    resort = LastResort(table)
    try:
        resort.prepare()
        left = True
    except CardFault:
        left = False
    resort.power_off()
    resort.hold([0.0] * len(table.outputs))
    resort.close()
    return left
