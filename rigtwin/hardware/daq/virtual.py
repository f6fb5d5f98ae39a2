"""A virtual PCI-6229 that answers a client's NI-DAQmx calls, with the twin at its terminals.

Reservations, ranges, names, the buffer of a clocked acquisition and the error codes are those that
NI documents, as far as a client such as `rigtwin.hardware.daq.card` uses them. All other calls are
refused by name.
"""

from __future__ import annotations

import re
import threading
from collections import deque
from collections.abc import Callable

import numpy as np
from google.protobuf.message import Message

from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.wired import Wired
from rigtwin.hardware.realtime import sleep_until
from rigtwin.system import monotonic

# Error codes of NI-DAQmx.
NO_DEVICE, NO_CHANNEL, RESERVED, BAD_VALUE, OVERWRITTEN, TIMEOUT, NO_TASK, GONE = (
    -200220, -200170, -50103, -200077, -200279, -200284, -200088, -88705
)  # fmt: skip
PRODUCT = "PCI-6229"
INPUT_RANGES = (0.2, 1.0, 5.0, 10.0)
"""Input ranges in V, in both directions. The outputs have 10 V only (NI 6229 specifications)."""
BUFFERED = 1000
"""Number of samples that a clocked acquisition buffers for a late client."""
_INITIALIZE, _ATTACH = 1, 2
"""Initialisation behaviours of NI's session service."""
_SUPPORTED = 10_000.0
"""Fastest sample clock that the twin supports, in Hz."""

Response = Callable[..., Message]
"""Class of a call's response, constructed from its fields."""


class DriverError(Exception):
    """Error of the driver: code and message."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class OnDemand:
    """Time of a card that waits for its reader: one period passes per sample read."""

    def begin(self) -> None: ...

    def next_tick(self, done: int) -> int:
        """Return the tick of the sample requested next."""
        return done + 1

    def now(self, done: int) -> int:
        """Return the number of ticks that have passed."""
        return done

    def wait(self, tick: int) -> None: ...


class RealTime:
    """Time of a card whose clock runs in real time."""

    def __init__(self, period: float) -> None:
        self._period, self._start = period, 0.0

    def begin(self) -> None:
        self._start = monotonic()

    def next_tick(self, done: int) -> int:
        return max(self.now(done), done)

    def now(self, _: int) -> int:
        return self.tick_at(monotonic())

    def tick_at(self, moment: float) -> int:
        """Return the tick at a time of `monotonic`, in s."""
        return int((moment - self._start) / self._period)

    def wait(self, tick: int) -> None:
        sleep_until(self._start + tick * self._period, spin=0.0)


class _Task:
    """Task of the driver; `next` is the tick of the sample it reads next."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines = list[str]()
        self.clocked = False
        self.running = False
        self.next = 0


class VirtualCard:
    """Virtual card. Its methods may be called from several threads.

    Before the first tick and after `disconnect` all outputs are zero.

    Parameters
    ----------
    terminals
        Rig at the card's terminals.
    wiring
        Name of the card, and lines of the terminals' signals.
    time
        Time of the card.

    Attributes
    ----------
    tick
        Number of periods that have passed.
    outputs
        Voltages at ao0 to ao3, shape (4,).
    power
        State of the digital line.
    """

    def __init__(self, terminals: Wired, wiring: ChannelTable, time: OnDemand | RealTime) -> None:
        self._terminals, self._time, self._device = terminals, time, wiring.device
        self._inputs = [line.line for line in wiring.inputs]
        self._outputs = [line.line for line in wiring.outputs]
        self._power_line = wiring.power
        # All four outputs of the card exist and drop to zero, whether or not a signal is wired to
        # them.
        self.outputs, self.power, self.tick, self.connected = np.zeros(4), False, 0, True
        self._volts = np.zeros(len(self._outputs))
        self._places = [int(line[2:]) for line in self._outputs]
        self._tasks: dict[str, _Task] = {}
        # A ring of the latest samples; the oldest are overwritten as on the real card.
        self._samples: deque[list[float]] = deque(maxlen=BUFFERED)
        # gRPC serves each call on a thread of its own.
        self._lock = threading.RLock()
        self._begun = False

    def answer(self, call: str, request: Message, response: Response) -> Message:
        """Answer a call.

        Parameters
        ----------
        call : str
            Name of the call in NI's gRPC service.
        request : Message
            Request of the call.
        response : Response
            Class of the response.

        Returns
        -------
        Message
            Response to the request.

        Raises
        ------
        DriverError
            If the driver would refuse the call.
        RigtwinError
            If the virtual card does not implement the call.
        """
        handler = getattr(self, f"_{call}", None)
        if handler is None:
            raise RigtwinError(f"the virtual card does not know the call {call}")
        # The wait is outside the lock, so that others may write while a reader waits.
        if call == "ReadAnalogF64":
            self._await(request)
        with self._lock:
            if not self.connected:
                raise DriverError(
                    GONE,
                    "The specified device is not present or is not active in the system. Device: "
                    f"{self._device}",
                )
            self._catch_up()
            return handler(request, response)

    def disconnect(self) -> None:
        """Pull the cable: the outputs drop to zero, and no call is answered any more."""
        self.connected, self.power = False, False
        self.outputs[:] = 0.0

    def run_until(self, tick: int) -> None:
        """Let time pass with the outputs held, whether or not anybody reads."""
        with self._lock:
            while self.tick < tick:
                self._step()

    def _step(self) -> None:
        self._volts[:] = self.outputs[self._places]
        self._terminals.advance(self._volts, self.power)
        self.tick += 1
        self._samples.append(self._terminals.volts.tolist())

    def _catch_up(self) -> None:
        """Advance the rig to the present; time begins with the first call."""
        if not self._begun:
            self._begun = True
            self._time.begin()
            self._samples.append(self._terminals.volts.tolist())
        self.run_until(self._time.now(self.tick))

    def _await(self, request: Message) -> None:
        """Wait until the requested samples exist."""
        if request.num_samps_per_chan > BUFFERED:
            raise DriverError(
                BAD_VALUE,
                "Requested value is not a supported value for this property. Samples: "
                f"{request.num_samps_per_chan}; the buffer holds {BUFFERED}",
            )
        task = self._tasks.get(request.task.name)
        if task is not None and task.running and task.clocked and self._begun:
            self._time.wait(task.next + max(request.num_samps_per_chan, 1) - 1)

    # One method per call of NI's gRPC service, with the service's name of the call. Attributes are
    # identified by the numbers of NI's header file NIDAQmx.h.

    def _task(self, request: Message) -> _Task:
        task = self._tasks.get(request.task.name)
        if task is None:
            raise DriverError(NO_TASK, "Task specified is invalid or does not exist.")
        return task

    def _GetSystemInfoAttributeUInt32(self, request: Message, response: Response) -> Message:
        # Major and minor version of the driver.
        return response(value={0x1272: 26, 0x1923: 5}.get(request.attribute_raw, 0))

    def _GetSystemInfoAttributeString(self, _: Message, response: Response) -> Message:
        return response(value=self._device)

    def _GetDeviceAttributeString(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        # DAQmx_Dev_AI_PhysicalChans, _AO_PhysicalChans and _DO_Lines.
        lists = {
            0x231E: [f"ai{n}" for n in range(32)],
            0x231F: [f"ao{n}" for n in range(4)],
            0x2322: [f"port0/line{n}" for n in range(32)],
        }
        # DAQmx_Dev_ProductType.
        if request.attribute_raw == 0x0631:
            return response(value=PRODUCT)
        return response(
            # The driver returns lists as one text.
            value=", ".join(
                f"{self._device}/{line}" for line in lists.get(request.attribute_raw, [])
            )
        )

    def _GetDeviceAttributeBool(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        return response(value=True)

    def _GetDeviceAttributeDouble(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        return response(value=_SUPPORTED)

    def _GetDeviceAttributeDoubleArray(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        # DAQmx_Dev_AI_VoltageRngs; the client's only other list of doubles is that of the
        # outputs.
        ranges = INPUT_RANGES if request.attribute_raw == 0x2990 else (10.0,)
        return response(value=[edge for volts in ranges for edge in (-volts, volts)])

    def _require_device(self, name: str) -> None:
        if name != self._device:
            raise DriverError(NO_DEVICE, f"Device identifier is invalid. Device specified: {name}")

    def _ResetDevice(self, request: Message, response: Response) -> Message:
        # A reset ends all tasks and sets the outputs to zero.
        self._require_device(request.device_name)
        self._tasks.clear()
        self.outputs[:] = 0.0
        self.power = False
        return response()

    def _CreateTask(self, request: Message, response: Response) -> Message:
        name = request.session_name or f"_unnamedTask<{len(self._tasks)}>"
        # INITIALIZE wants a new session, ATTACH an existing one.
        new = name not in self._tasks
        if new and request.initialization_behavior == _ATTACH:
            raise DriverError(NO_TASK, f"No session of the name {name} to attach to.")
        if not new and request.initialization_behavior == _INITIALIZE:
            raise DriverError(RESERVED, f"A session of the name {name} exists already.")
        if new:
            self._tasks[name] = _Task(name)
        made = response(new_session_initialized=new)
        made.task.name = name
        return made

    def _GetTaskAttributeString(self, request: Message, response: Response) -> Message:
        return response(value=self._task(request).name)

    def _add(self, request: Message, text: str, kind: str, count: int) -> _Task:
        """Add the channels named in a text to a task."""
        task = self._task(request)
        for line in text.split(","):
            device, _, name = line.strip().partition("/")
            self._require_device(device)
            number = re.fullmatch(rf"{kind}(\d+)", name)
            if number is None or int(number[1]) >= count:
                raise DriverError(
                    NO_CHANNEL,
                    "Physical channel specified does not exist on this device. Channel: "
                    f"{line.strip()}",
                )
            task.lines.append(name)
        return task

    def _voltage(self, request: Message, allowed: tuple[float, ...]) -> None:
        """Raise DriverError if the requested range exceeds the card's."""
        # The driver takes any range up to the largest, and uses the next that covers it.
        if max(abs(request.min_val), abs(request.max_val)) > max(allowed):
            raise DriverError(
                BAD_VALUE,
                "Requested value is not a supported value for this property. Maximum value: "
                f"{max(allowed)}",
            )

    def _CreateAIVoltageChan(self, request: Message, response: Response) -> Message:
        self._voltage(request, INPUT_RANGES)
        self._add(request, request.physical_channel, "ai", 32)
        return response()

    def _CreateAOVoltageChan(self, request: Message, response: Response) -> Message:
        self._voltage(request, (10.0,))
        self._add(request, request.physical_channel, "ao", 4)
        return response()

    def _CreateDOChan(self, request: Message, response: Response) -> Message:
        self._add(request, request.lines, "port0/line", 32)
        return response()

    def _CfgSampClkTiming(self, request: Message, response: Response) -> Message:
        if not 0.0 < request.rate <= _SUPPORTED:
            raise DriverError(
                BAD_VALUE,
                f"Requested value is not a supported value for this property. Rate: {request.rate}",
            )
        self._task(request).clocked = True
        return response()

    def _StartTask(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        # As on the real card, a line belongs to one running task at a time.
        for running in self._tasks.values():
            both = set(running.lines) & set(task.lines)
            if running is not task and running.running and both:
                raise DriverError(
                    RESERVED,
                    f"The specified resource is reserved. Task {running.name}, channel {min(both)}",
                )
        task.running, task.next = True, self.tick
        return response()

    def _StopTask(self, request: Message, response: Response) -> Message:
        self._task(request).running = False
        return response()

    def _ClearTask(self, request: Message, response: Response) -> Message:
        self._tasks.pop(request.task.name, None)
        return response()

    def _GetReadAttributeUInt32(self, request: Message, response: Response) -> Message:
        # DAQmx_Read_AvailSampPerChan: samples from the next unread one up to the present.
        return response(value=max(self._time.now(self.tick) - self._task(request).next + 1, 0))

    def _ReadAnalogF64(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        if not task.running:
            task.running, task.next = True, self.tick
        count = max(request.num_samps_per_chan, 1)
        if task.clocked:
            # Time on demand passes by being read; in real time `_await` has waited already.
            if task.next + count - 1 > self.tick:
                self.run_until(task.next + count - 1)
            # The buffer holds the latest samples; a reader that is too late has lost its own.
            behind = self.tick - task.next
            if behind >= len(self._samples):
                raise DriverError(
                    OVERWRITTEN, "Attempted to read samples that are no longer available."
                )
            task.next += count
        # On demand: the first reading shows the present, each later one the next tick.
        else:
            if task.next > 0:
                self.run_until(self._time.next_tick(self.tick))
            task.next, behind, count = 1, 0, 1
        samples = [self._samples[-1 - behind + number] for number in range(count)]
        # A channel without a signal reads 0 V, as an input that is shorted to ground.
        places = [self._inputs.index(line) if line in self._inputs else -1 for line in task.lines]
        values = [sample[place] if place >= 0 else 0.0 for place in places for sample in samples]
        return response(read_array=values, samps_per_chan_read=count)

    def _WriteAnalogF64(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        if len(request.write_array) != len(task.lines):
            raise DriverError(
                BAD_VALUE,
                f"{len(request.write_array)} values written to {len(task.lines)} channels",
            )
        for line, volts in zip(task.lines, request.write_array, strict=True):
            # Written so that NaN is refused.
            if not abs(volts) <= 10.0:
                raise DriverError(
                    BAD_VALUE,
                    f"Requested value is not a supported value for this property. Value: {volts} V",
                )
            self.outputs[int(line[2:])] = volts
        return response(samps_per_chan_written=1)

    def _WriteDigitalLines(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        # Other digital lines exist, but nothing is connected to them.
        for line, level in zip(task.lines, request.write_array, strict=False):
            if line == self._power_line:
                self.power = bool(level)
        return response(samps_per_chan_written=1)

    def _GetErrorString(self, _: Message, response: Response) -> Message:
        return response(error_string="")
