"""A virtual PCI-6229.

Answers the NI-DAQmx calls of a client, volts in and out, with the twin at its terminals.

Reservations, ranges, names, the buffer of a clocked acquisition and the driver's error codes are
those that NI documents, as far as a client such as `rigtwin.hardware.daq.card` meets them; any
other call is refused by name.
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

NO_DEVICE, NO_CHANNEL, RESERVED, BAD_VALUE, OVERWRITTEN, TIMEOUT, NO_TASK, GONE = (
    -200220, -200170, -50103, -200077, -200279, -200284, -200088, -88705
)  # fmt: skip
PRODUCT = "PCI-6229"
INPUT_RANGES = (0.2, 1.0, 5.0, 10.0)
"""V, both ways; the outputs have 10 V only (NI 6229 specifications)."""
BUFFERED = 1000
"""Samples that a clocked acquisition keeps for a client that is late."""
_INITIALIZE, _ATTACH = 1, 2
"""Session initialization behaviours of NI's session service."""
_SUPPORTED = 10_000.0
"""Hz, the fastest sample clock that the twin is worth."""

Response = Callable[..., Message]
"""Class of a call's response, made of its fields."""


class DriverError(Exception):
    """An error as the driver gives it: code and message."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class OnDemand:
    """Time of a card that nobody waits for: one period passes with each sample that is read."""

    def begin(self) -> None: ...

    def next_tick(self, done: int) -> int:
        """The tick of the sample that is asked for next."""
        return done + 1

    def now(self, done: int) -> int:
        """Ticks that have passed by now."""
        return done

    def wait(self, tick: int) -> None: ...


class RealTime:
    """Time of a card whose clock runs."""

    def __init__(self, period: float) -> None:
        self._period, self._start = period, 0.0

    def begin(self) -> None:
        self._start = monotonic()

    def next_tick(self, done: int) -> int:
        return max(self.now(done), done)

    def now(self, _: int) -> int:
        return self.tick_at(monotonic())

    def tick_at(self, moment: float) -> int:
        """The tick that a moment of `monotonic` lies in."""
        return int((moment - self._start) / self._period)

    def wait(self, tick: int) -> None:
        sleep_until(self._start + tick * self._period, spin=0.0)


class _Task:
    def __init__(self, name: str) -> None:
        self.name, self.lines, self.clocked, self.running, self.next = (
            name,
            list[str](),
            False,
            False,
            0,
        )


class VirtualCard:
    """One card.

    Thread-safe. `answer` takes a call's name, its request, and the class of its response.

    tick: periods that have passed. outputs: volts at ao0 to ao3, shape (4,). power: the digital
    line. Before the first tick and after `disconnect` all outputs are at zero. wiring: the card's
    name, and which lines the terminals' signals are on.
    """

    def __init__(
        self,
        terminals: Wired,
        wiring: ChannelTable,
        time: OnDemand | RealTime,
    ) -> None:
        self._terminals, self._time, self._device = terminals, time, wiring.device
        self._inputs, self._outputs = (
            [line.line for line in wiring.inputs],
            [line.line for line in wiring.outputs],
        )
        self._power_line = wiring.power
        self.outputs, self.power, self.tick, self.connected = np.zeros(4), False, 0, True
        self._volts = np.zeros(len(self._outputs))
        self._places = [int(line[2:]) for line in self._outputs]
        self._tasks: dict[str, _Task] = {}
        self._samples: deque[list[float]] = deque(maxlen=BUFFERED)
        self._lock = threading.RLock()
        self._begun = False

    def answer(self, call: str, request: Message, response: Response) -> Message:
        """Answers a call.

        Parameters
        ----------
        call : str
            Its name in NI's gRPC service.
        request : Message
            What it asks.
        response : Response
            What its answer is made with.

        Returns
        -------
        Message
            The answer.

        Raises
        ------
        DriverError
            As the driver would.
        RigtwinError
            For a call that no client of this project makes.
        """
        handler = getattr(self, f"_{call}", None)
        if handler is None:
            raise RigtwinError(f"the virtual card does not know the call {call}")
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
        """The cable is pulled: the outputs' terminals are at zero and nothing answers any more."""
        self.connected, self.power = False, False
        self.outputs[:] = 0.0

    def run_until(self, tick: int) -> None:
        """Lets time pass with the outputs held, whether or not anybody reads."""
        with self._lock:
            while self.tick < tick:
                self._step()

    def _step(self) -> None:
        self._volts[:] = self.outputs[self._places]
        self._terminals.advance(self._volts, self.power)
        self.tick += 1
        self._samples.append(self._terminals.volts.tolist())

    def _catch_up(self) -> None:
        if not self._begun:
            self._begun = True
            self._time.begin()
            self._samples.append(self._terminals.volts.tolist())
        self.run_until(self._time.now(self.tick))

    def _await(self, request: Message) -> None:
        """Outside the lock: others may write while a reader waits for its sample."""
        if request.num_samps_per_chan > BUFFERED:
            raise DriverError(
                BAD_VALUE,
                "Requested value is not a supported value for this property. Samples: "
                f"{request.num_samps_per_chan}; the buffer holds {BUFFERED}",
            )
        task = self._tasks.get(request.task.name)
        if task is not None and task.running and task.clocked and self._begun:
            self._time.wait(task.next + max(request.num_samps_per_chan, 1) - 1)

    # The calls, by their names in the gRPC service.

    def _task(self, request: Message) -> _Task:
        task = self._tasks.get(request.task.name)
        if task is None:
            raise DriverError(NO_TASK, "Task specified is invalid or does not exist.")
        return task

    def _GetSystemInfoAttributeUInt32(self, request: Message, response: Response) -> Message:
        return response(value={0x1272: 26, 0x1923: 5}.get(request.attribute_raw, 0))

    def _GetSystemInfoAttributeString(self, _: Message, response: Response) -> Message:
        return response(value=self._device)

    def _GetDeviceAttributeString(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        lists = {
            0x231E: [f"ai{n}" for n in range(32)],
            0x231F: [f"ao{n}" for n in range(4)],
            0x2322: [f"port0/line{n}" for n in range(32)],
        }
        if request.attribute_raw == 0x0631:
            return response(value=PRODUCT)
        return response(
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
        ranges = INPUT_RANGES if request.attribute_raw == 0x2990 else (10.0,)
        return response(value=[edge for volts in ranges for edge in (-volts, volts)])

    def _require_device(self, name: str) -> None:
        if name != self._device:
            raise DriverError(NO_DEVICE, f"Device identifier is invalid. Device specified: {name}")

    def _ResetDevice(self, request: Message, response: Response) -> Message:
        self._require_device(request.device_name)
        self._tasks.clear()
        self.outputs[:] = 0.0
        self.power = False
        return response()

    def _CreateTask(self, request: Message, response: Response) -> Message:
        name = request.session_name or f"_unnamedTask<{len(self._tasks)}>"
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
        for other in self._tasks.values():
            both = set(other.lines) & set(task.lines)
            if other is not task and other.running and both:
                raise DriverError(
                    RESERVED,
                    f"The specified resource is reserved. Task {other.name}, channel {min(both)}",
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
        return response(value=max(self._time.now(self.tick) - self._task(request).next + 1, 0))

    def _ReadAnalogF64(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        if not task.running:
            task.running, task.next = True, self.tick
        count = max(request.num_samps_per_chan, 1)
        if task.clocked:
            if task.next + count - 1 > self.tick:
                self.run_until(task.next + count - 1)
            behind = self.tick - task.next
            if behind >= len(self._samples):
                raise DriverError(
                    OVERWRITTEN, "Attempted to read samples that are no longer available."
                )
            task.next += count
        else:
            if task.next > 0:
                self.run_until(self._time.next_tick(self.tick))
            task.next, behind, count = 1, 0, 1
        samples = [self._samples[-1 - behind + number] for number in range(count)]
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
            if not abs(volts) <= 10.0:
                raise DriverError(
                    BAD_VALUE,
                    f"Requested value is not a supported value for this property. Value: {volts} V",
                )
            self.outputs[int(line[2:])] = volts
        return response(samps_per_chan_written=1)

    def _WriteDigitalLines(self, request: Message, response: Response) -> Message:
        task = self._task(request)
        for line, level in zip(task.lines, request.write_array, strict=False):
            if line == self._power_line:
                self.power = bool(level)
        return response(samps_per_chan_written=1)

    def _GetErrorString(self, _: Message, response: Response) -> Message:
        return response(error_string="")
