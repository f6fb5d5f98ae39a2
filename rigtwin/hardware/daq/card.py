"""A rig behind an NI card, accessed through the nidaqmx package.

The card is driven by this computer's driver or by a gRPC device server.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from rigtwin.hardware.daq.conversion import conversion, rows
from rigtwin.hardware.daq.driver import CardFault, translate_errors
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.realtime import Pacer
from rigtwin.system import monotonic

if TYPE_CHECKING:
    import grpc

TIMEOUT = 0.1
"""Maximum time to wait for a sample, in s. A card that is silent for longer is considered gone."""
INPUTS, OUTPUTS, PRESSURE = "rigtwin-inputs", "rigtwin-outputs", "rigtwin-pressure"
"""Names of the tasks. A guardian finds the outputs by them after their owner has died."""


class Card:
    """A `DrivenRig` on a card.

    Inputs are clocked by the card if the table says so, otherwise by this computer. Outputs act
    immediately. Nothing moves before `write` or `power`.

    Attributes
    ----------
    missed
        Number of ticks whose samples came too late to be answered.
    late
        Delay of the last reading after its due time, in s.
    """

    def __init__(
        self,
        table: ChannelTable,
        period: float,
        channel: grpc.Channel | None,
        clock: Callable[[], float] = monotonic,
        pacer: Pacer | None = None,
    ) -> None:
        """Prepare a card without opening it.

        Parameters
        ----------
        table
            Channel table of the card.
        period
            Period of a tick, in s.
        channel
            Connection to a gRPC device server; None for this computer's driver.
        clock
            Clock of the card's time, in s. A virtual card has its own.
        pacer
            Source of ticks for a card that has no clock.
        """
        self._table, self._period, self._channel = table, period, channel
        # A tick converts a few numbers: passing them to compiled code would take longer.
        self._inputs = rows(conversion(table.inputs))
        self._outputs = rows(conversion(table.outputs))
        self._volts, self._asked = np.zeros(len(table.inputs)), np.zeros(len(table.outputs))
        self._signals = table.signals
        self._pacer, self._clock = pacer, clock
        self._start, self._count, self.missed, self.late = -1.0, 0, 0, 0.0
        self._tasks: list[Any] = []

    def inspect(self) -> None:
        """Check that the card exists and has what the table requires. Nothing moves.

        Raises
        ------
        CardFault
            If card, lines or ranges are missing.
        """
        from nidaqmx.system import System

        table = self._table
        with translate_errors(f"card {table.device}"):
            options = self._options("")
            system = System.local() if options is None else System.remote(options)
            names = [device.name for device in system.devices]
            if table.device not in names:
                raise CardFault(
                    f"no card {table.device!r}; the driver knows {', '.join(names) or 'none'}"
                )
            device = system.devices[table.device]
            available = {
                "inputs": [channel.name for channel in device.ai_physical_chans],
                "outputs": [channel.name for channel in device.ao_physical_chans],
            }
            if table.physical(table.power) not in [line.name for line in device.do_lines]:
                raise CardFault(
                    f"card.{table.signals.power}: {device.product_type} has no line {table.power}"
                )
            ranges = {"inputs": device.ai_voltage_rngs, "outputs": device.ao_voltage_rngs}
            for group, lines in (("inputs", table.inputs), ("outputs", table.outputs)):
                for line in lines:
                    if table.physical(line.line) not in available[group]:
                        raise CardFault(
                            f"{group}.{line.name}: {device.product_type} has no line {line.line}"
                        )
                    # The driver lists both ends of every range, −10 and 10 for ±10 V.
                    if line.scaling.range not in ranges[group]:
                        known = ", ".join(
                            f"{volts:g}" for volts in sorted({abs(edge) for edge in ranges[group]})
                        )
                        raise CardFault(
                            f"{group}.{line.name}.range = {line.scaling.range:g} V: "
                            f"{device.product_type} has {known} V"
                        )

    def start(self) -> None:
        """Reserve the lines, and start sampling. Raise CardFault if a line is in use."""
        from nidaqmx import Task
        from nidaqmx.constants import AcquisitionType
        from nidaqmx.stream_readers import AnalogMultiChannelReader
        from nidaqmx.stream_writers import AnalogMultiChannelWriter, DigitalSingleChannelWriter

        table = self._table
        with translate_errors(f"card {table.device}"):
            inputs, outputs, pressure = (
                self._task(Task, name) for name in (INPUTS, OUTPUTS, PRESSURE)
            )
            for line in table.inputs:
                volts = line.scaling.range
                inputs.ai_channels.add_ai_voltage_chan(
                    table.physical(line.line), min_val=-volts, max_val=volts
                )
            for line in table.outputs:
                volts = line.scaling.range
                outputs.ao_channels.add_ao_voltage_chan(
                    table.physical(line.line), min_val=-volts, max_val=volts
                )
            pressure.do_channels.add_do_chan(table.physical(table.power))
            if table.timing == "hardware":
                # The buffer of 1000 samples covers a second in which the loop may be late.
                inputs.timing.cfg_samp_clk_timing(
                    1.0 / self._period, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=1000
                )
            self._reader = AnalogMultiChannelReader(inputs.in_stream)
            self._writer = AnalogMultiChannelWriter(outputs.out_stream)
            # Shapes are right by construction; checking them costs microseconds in every tick.
            self._reader.verify_array_shape = self._writer.verify_array_shape = False
            self._writer.auto_start = False
            # Outputs first: once samples arrive, the loop must be able to answer them.
            for task in (outputs, pressure, inputs):
                task.start()
            self._stream = inputs.in_stream
            self._power = DigitalSingleChannelWriter(pressure.out_stream)
            self._power.auto_start = False

    def read(self) -> tuple[float, ...]:
        """Wait for the next sample, and return it as the signals' values."""
        self.missed = 0
        if self._pacer is not None:
            self.missed, self.late = self._pacer.wait(), self._pacer.late
        try:
            self._reader.read_one_sample(self._volts, TIMEOUT)  # type: ignore[arg-type]
            # A paced card has no buffer: each read converts at the moment of the call.
            if self._pacer is None:
                self._drop_old_samples()
        except Exception as error:
            with translate_errors(f"card {self._table.device} gives no sample"):
                raise error
        # Plain floats: arithmetic on numpy scalars is several times slower.
        samples = zip(self._inputs, self._volts.tolist(), strict=True)
        return self._signals.sample(
            *[factor * volts + offset for (factor, offset, _), volts in samples]
        )

    def _drop_old_samples(self) -> None:
        """Skip samples that wait in the buffer because the loop was late; use only the newest."""
        now = self._clock()
        if self._start < 0.0:
            self._start = now
        self.late = now - (self._start + self._count * self._period)
        # Less than half a period is jitter of the two clocks, not a sample that waits.
        if self.late > 0.5 * self._period:
            # Samples count as missed only if the card has them: the computer's clock may be off.
            self.missed = self._stream.avail_samp_per_chan
            if self.missed:
                waiting = np.empty((len(self._volts), self.missed))
                self._reader.read_many_sample(waiting, self.missed, TIMEOUT)
                self._volts[:] = waiting[:, -1]
            self._count += self.missed
        elif self.late < 0.0:
            # The card's clock runs ahead of the computer's, or the first tick was late. Deadlines
            # are counted from the card's ticks, so the reference is moved.
            self._start, self.late = now - self._count * self._period, 0.0
        self._count += 1

    def write(self, commands: tuple[float, ...]) -> None:
        """Set the outputs, clipped to the range of each line."""
        self._asked[:] = self._to_volts(self._signals.to_write(commands))
        try:
            self._writer.write_one_sample(self._asked)
        except Exception as error:
            with translate_errors(f"card {self._table.device} takes no output"):
                raise error

    def _to_volts(self, values: list[float]) -> list[float]:
        """Return voltages, by the inverse of value = factor · volts + offset."""
        asked = zip(self._outputs, values, strict=True)
        return [
            min(max((value - offset) / factor, -reach), reach)
            for (factor, offset, reach), value in asked
        ]

    def power(self, on: bool) -> None:
        """Switch the digital line that enables the actuators' power."""
        table = self._table
        with translate_errors(f"card {table.device}: {table.signals.power} line {table.power}"):
            self._power.write_one_sample_one_line(on)

    def stop(self) -> None:
        """Set forces to zero, switch the power off, and release the lines.

        A card that accepts no output is reset, which sets its outputs to zero. Errors are never
        raised: stopping goes on with whatever still works.
        """
        # Without all three tasks the card was never started, and has nothing to stop.
        if len(self._tasks) == 3:
            # Zero force is the voltage that the table's offset assigns to it, which need not be 0
            # V.
            zeros = self._to_volts([0.0] * len(self._outputs))
            for place in self._signals.released_places:
                self._asked[place] = zeros[place]
            # Every step is tried even if the one before failed: power off is safer than nothing.
            refused = False
            try:
                self._writer.write_one_sample(self._asked)
            except Exception:
                refused = True
            try:
                self._power.write_one_sample_one_line(False)
            except Exception:
                refused = True
            if refused:
                with suppress(Exception):
                    # A reset is the last means: it ends every task on the card, not only these.
                    self._device().reset_device()
        for task in self._tasks:
            with suppress(Exception):
                task.close()
        self._tasks = []

    def _device(self) -> Any:
        from nidaqmx.system import System

        options = self._options("")
        return (System.local() if options is None else System.remote(options)).devices[
            self._table.device
        ]

    def _options(self, name: str) -> Any:
        if self._channel is None:
            return None
        from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior

        # A new session must not silently take over the tasks of another program.
        new = SessionInitializationBehavior.INITIALIZE_SERVER_SESSION
        return GrpcSessionOptions(self._channel, name, initialization_behavior=new)

    def _task(self, kind: Any, name: str) -> Any:
        """Create a task under a name by which other processes can find it."""
        try:
            task = (
                kind(name, grpc_options=self._options(name))
                if self._channel is not None
                else kind(name)
            )
        except Exception as error:
            with translate_errors(
                f"card {self._table.device}: {name} is in use; if by a program that died, "
                "rigtwin card release"
            ):
                raise error
        self._tasks.append(task)
        return task
