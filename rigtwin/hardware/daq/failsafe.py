"""Fail-safe outputs: sets a card's outputs to safe values after their owner died or hung."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from rigtwin.hardware.daq.card import INPUTS, OUTPUTS, PRESSURE
from rigtwin.hardware.daq.conversion import conversion, to_volts
from rigtwin.hardware.daq.driver import CardFault, connect, translate_errors
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.numerics.arrays import Array


class FailsafeOutputs:
    """Access to a card's outputs in place of the process that owned them.

    On a gRPC device server the owner's tasks are found by their names, even while the owner lives.
    A driver on this computer frees the lines when their owner's process is gone. They are then
    reserved anew.
    """

    def __init__(self, table: ChannelTable) -> None:
        self._table, self._conversion = table, conversion(table.outputs)
        self._outputs: Any = None
        self._power: Any = None
        self._tasks: list[Any] = []
        count = len(table.outputs)
        self._values, self._volts = np.zeros(count), np.empty(count)
        # Compilation and loading of the driver's client take seconds, which an emergency has not.
        to_volts(self._conversion, self._values, self._volts)
        connect(table.address)

    def prepare(self) -> None:
        """Attach to the owner's tasks once it has them. Raise CardFault if that fails."""
        # Without a server there is nothing to attach to while the owner lives.
        if self._table.address:
            with translate_errors(f"card {self._table.device}: watching it"):
                self._attach()

    def hold(self, outputs: Sequence[float] | Array) -> None:
        """Set the outputs to safe values: zero force, positions held.

        Parameters
        ----------
        outputs
            Value of each output, in its unit.

        Raises
        ------
        CardFault
            If the card accepts no output.
        """
        self._values[:] = outputs
        to_volts(self._conversion, self._values, self._volts)
        with translate_errors(f"card {self._table.device}: stopping it"):
            # A driver on this computer frees the owner's lines at its death, so only now can they
            # be reserved.
            if self._outputs is None:
                self._take()
            assert self._outputs is not None
            self._outputs.write_one_sample(self._volts)

    def power_off(self) -> None:
        """Switch the actuators' power off. Raise CardFault if the card does not."""
        with translate_errors(f"card {self._table.device}: taking its power off"):
            if self._power is None:
                self._take()
            assert self._power is not None
            self._power.write_one_sample_one_line(False)

    def close(self) -> None:
        """Release the lines."""
        for task in self._tasks:
            with suppress(Exception):
                task.stop()
            with suppress(Exception):
                task.close()
        self._tasks, self._outputs, self._power = [], None, None

    def _attach(self) -> None:
        """Attach to the owner's tasks on a gRPC device server."""
        from nidaqmx import Task
        from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior

        channel = connect(self._table.address)
        attach = SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION
        assert channel is not None
        # The writers take the first two by their place. The inputs are attached so that `close`
        # also ends the owner's acquisition.
        for name in (OUTPUTS, PRESSURE, INPUTS):
            options = GrpcSessionOptions(channel, name, initialization_behavior=attach)
            self._tasks.append(Task(name, grpc_options=options))
        self._open_writers(started=True)

    def _take(self) -> None:
        """Reserve the outputs under new names."""
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
        # Outputs and power only: the inputs are of no use any more.
        self._tasks = [outputs, pressure]
        for line in self._table.outputs:
            volts = line.scaling.range
            outputs.ao_channels.add_ao_voltage_chan(
                self._table.physical(line.line), min_val=-volts, max_val=volts
            )
        pressure.do_channels.add_do_chan(self._table.physical(self._table.power))
        self._open_writers(started=False)

    def _open_writers(self, started: bool) -> None:
        """Open writers on the tasks; tasks that run already must not be started again."""
        from nidaqmx.stream_writers import AnalogMultiChannelWriter, DigitalSingleChannelWriter

        self._outputs = AnalogMultiChannelWriter(self._tasks[0].out_stream)
        self._power = DigitalSingleChannelWriter(self._tasks[1].out_stream)
        self._outputs.verify_array_shape = self._power.verify_array_shape = False
        self._outputs.auto_start = self._power.auto_start = not started


def release(table: ChannelTable) -> bool:
    """Free the lines that a dead program has left reserved on a gRPC device server.

    Forces are set to zero, the power is switched off, and the tasks are ended.

    Returns
    -------
    bool
        Whether any task was left.

    Raises
    ------
    CardFault
        If the outputs could not be set.
    """
    outputs = FailsafeOutputs(table)
    try:
        outputs.prepare()
        reserved = True
    except CardFault:
        reserved = False
    # Power off first: it makes the rig safe even if the outputs then fail.
    outputs.power_off()
    outputs.hold([0.0] * len(table.outputs))
    outputs.close()
    return reserved
