"""A rig behind an NI card, through the nidaqmx package.

The driver of this computer, or a gRPC device server.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.conversion import conversion, rows
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.realtime import Pacer
from rigtwin.system import monotonic

if TYPE_CHECKING:
    import grpc

TIMEOUT = 0.1
"""s that a sample may be awaited: a card that stays silent so long is not there."""
DRIVER = (
    "install NI-DAQmx from ni.com, or name a gRPC device server in the channel table: card.address"
)
PACKAGE = "the nidaqmx package is missing; pip install 'rigtwin[daq]'"
INPUTS, OUTPUTS, PRESSURE = "rigtwin-inputs", "rigtwin-outputs", "rigtwin-pressure"
"""Names of the tasks, by which a guardian finds the outputs when their owner is dead."""


class CardFault(RigtwinError):
    """The card, its driver or the way to it does not do what it was asked."""


@contextmanager
def translate_errors(doing: str) -> Iterator[None]:
    """Gives what nidaqmx raises as a CardFault of one line."""
    from nidaqmx.errors import DaqNotFoundError, DaqNotSupportedError, Error, RpcError

    try:
        yield
    except (DaqNotFoundError, DaqNotSupportedError):
        raise CardFault(f"the NI-DAQmx driver is missing on this computer; {DRIVER}") from None
    except RpcError as error:
        raise CardFault(f"{doing}: {str(error).splitlines()[0]}") from None
    except Error as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        raise CardFault(f"{doing}: {' '.join(lines[:4])}") from None
    except (AssertionError, ValueError, TypeError) as error:
        # The client's own checks of what a card has answered.
        raise CardFault(
            f"{doing}: it answered what the driver's client does not take: "
            f"{error or type(error).__name__}"
        ) from None


def require_client() -> None:
    """Raises CardFault unless the driver's client is installed, with what a virtual card needs."""
    try:
        import grpc  # noqa: F401
        import nidaqmx  # noqa: F401
    except ImportError:
        raise CardFault(PACKAGE) from None


def connect(address: str) -> grpc.Channel | None:
    """The connection to a gRPC device server, or None for this computer's driver.

    Raises CardFault.
    """
    require_client()
    if not address:
        return None
    import grpc

    # A server that is frozen, or a network that is gone, must be noticed: the client's calls have
    # no end of their own.
    alive = (
        ("grpc.keepalive_time_ms", 1000),
        ("grpc.keepalive_timeout_ms", 1000),
        ("grpc.http2.max_pings_without_data", 0),
    )
    return grpc.insecure_channel(address, options=alive)


class Card:
    """A `DrivenRig` on a card.

    Inputs are clocked by the card where the table says so, else by this computer; outputs act at
    once. Nothing moves before `write` or `pressure`.

    missed: ticks whose samples came too late to be answered. late: s by which the last sample was
    read after it was due.
    """

    def __init__(
        self,
        table: ChannelTable,
        period: float,
        channel: grpc.Channel | None,
        clock: Callable[[], float] = monotonic,
        pacer: Pacer | None = None,
    ) -> None:
        """period in s.

        Channel: to a gRPC device server; clock: s, of the time that the card lives in; pacer:
        waits for the ticks of a card that has no clock of its own.
        """
        self._table, self._period, self._channel = table, period, channel
        # A tick converts a few numbers: handing them to compiled code would take longer.
        self._inputs, self._outputs = (
            rows(conversion(table.inputs)),
            rows(conversion(table.outputs)),
        )
        self._volts, self._asked = np.zeros(len(table.inputs)), np.zeros(len(table.outputs))
        self._signals = table.signals
        self._pacer, self._clock = pacer, clock
        self._start, self._count, self.missed, self.late = -1.0, 0, 0, 0.0
        self._tasks: list[Any] = []

    def inspect(self) -> None:
        """Looks whether the card is there and has what the table asks of it.

        Raises CardFault; moves nothing.
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
            there = {
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
                    if table.physical(line.line) not in there[group]:
                        raise CardFault(
                            f"{group}.{line.name}: {device.product_type} has no line {line.line}"
                        )
                    if line.scaling.range not in ranges[group]:
                        known = ", ".join(
                            f"{volts:g}" for volts in sorted({abs(edge) for edge in ranges[group]})
                        )
                        raise CardFault(
                            f"{group}.{line.name}.range = {line.scaling.range:g} V: "
                            f"{device.product_type} has {known} V"
                        )

    def start(self) -> None:
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
                inputs.timing.cfg_samp_clk_timing(
                    1.0 / self._period, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=1000
                )
            self._reader, self._writer = (
                AnalogMultiChannelReader(inputs.in_stream),
                AnalogMultiChannelWriter(outputs.out_stream),
            )
            self._reader.verify_array_shape = self._writer.verify_array_shape = False
            self._writer.auto_start = False
            for task in (outputs, pressure, inputs):
                task.start()
            self._stream, self._power = (
                inputs.in_stream,
                DigitalSingleChannelWriter(pressure.out_stream),
            )
            self._power.auto_start = False

    def read(self) -> tuple[float, ...]:
        self.missed = 0
        if self._pacer is not None:
            self.missed, self.late = self._pacer.wait(), self._pacer.late
        try:
            self._reader.read_one_sample(self._volts, TIMEOUT)  # type: ignore[arg-type]
            if self._pacer is None:
                self._drop_what_is_old()
        except Exception as error:
            with translate_errors(f"card {self._table.device} gives no sample"):
                raise error
        samples = zip(self._inputs, self._volts.tolist(), strict=True)
        return self._signals.sample(
            *[factor * volts + offset for (factor, offset, _), volts in samples]
        )

    def _drop_what_is_old(self) -> None:
        """A loop that was late finds samples waiting: only the last is worth an answer."""
        now = self._clock()
        if self._start < 0.0:
            self._start = now
        self.late = now - (self._start + self._count * self._period)
        if self.late > 0.5 * self._period:
            self.missed = self._stream.avail_samp_per_chan
            if self.missed:
                waiting = np.empty((len(self._volts), self.missed))
                self._reader.read_many_sample(waiting, self.missed, TIMEOUT)
                self._volts[:] = waiting[:, -1]
            self._count += self.missed
        elif self.late < 0.0:
            # The card's clock is ahead of the computer's, or the first tick was late: its ticks
            # are the measure.
            self._start, self.late = now - self._count * self._period, 0.0
        self._count += 1

    def write(self, commands: tuple[float, ...]) -> None:
        self._asked[:] = self._to_volts(self._signals.to_write(commands))
        try:
            self._writer.write_one_sample(self._asked)
        except Exception as error:
            with translate_errors(f"card {self._table.device} takes no output"):
                raise error

    def _to_volts(self, values: list[float]) -> list[float]:
        asked = zip(self._outputs, values, strict=True)
        return [
            min(max((value - offset) / factor, -reach), reach)
            for (factor, offset, reach), value in asked
        ]

    def power(self, on: bool) -> None:
        table = self._table
        with translate_errors(f"card {table.device}: {table.signals.power} line {table.power}"):
            self._power.write_one_sample_one_line(on)

    def stop(self) -> None:
        """Forces to zero, power off, the card's lines given back.

        A card that takes no output any more is reset, which sets them to zero. Never raises: there
        is nobody left to hear it.
        """
        if len(self._tasks) == 3:
            nothing = self._to_volts([0.0] * len(self._outputs))
            for place in self._signals.released_places:
                self._asked[place] = nothing[place]
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

        new = SessionInitializationBehavior.INITIALIZE_SERVER_SESSION
        return GrpcSessionOptions(self._channel, name, initialization_behavior=new)

    def _task(self, kind: Any, name: str) -> Any:
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
