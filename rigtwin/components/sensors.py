"""Sensors: their parameters, and what each makes of the quantity that it measures, noise and
quantisation apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delay_sample, ring

INVERTIBLE = 80.0
"""Hz, up to which a sensor's lag is undone."""
PADDED = 50
"""Samples that a zero-phase filter needs."""


class Lvdt(NamedTuple):
    """Position sensor as the DAQ reads it."""

    white: Annotated[float, Quantity("m", 0.0, 0.01, "rms, thesis §3.4 (±5e-4 m in all)")] = 6e-5
    hum: Annotated[float, Quantity("m", 0.0, 0.01, "amplitude of the mains line, thesis §3.4")] = (
        2e-4
    )
    resolution: Annotated[float, Quantity("m", 0.0, 0.01, "16 bit")] = 4.6e-6
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -0.05, 0.05, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s", -0.01, 0.01, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, NONE)] = 0.0


class LoadCell(NamedTuple):
    """Force sensor Interface 1010AF between motor rod and plate, as the DAQ reads it."""

    white: Annotated[float, Quantity("N", 0.0, 500.0, "rms, thesis §3.4 (±12 N in all)")] = 1.5
    hum: Annotated[float, Quantity("N", 0.0, 500.0, "amplitude of the mains line, thesis §3.4")] = (
        5.0
    )
    resolution: Annotated[float, Quantity("N", 0.0, 100.0, "16 bit of ±2.5 kN")] = 0.076
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -500.0, 500.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("N/s", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, NONE)] = 0.0


class PositionSensor(NamedTuple):
    """Position as the recording has it."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    white: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0


class VelocitySensor(NamedTuple):
    """Velocity as the recording has it."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m/s", -100.0, 100.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s^2", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    white: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0


class ForceSensor(NamedTuple):
    """Force that moves the joint, positive where it moves it on, as the recording has it.

    A negative lag or delay means that the force acts later than it is recorded: what is recorded is
    the command of an actuator, which follows it late.
    """

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("N/s", -1e7, 1e7, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", -1.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", -1.0, 10.0, NONE)] = 0.0
    white: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0


DECLARED = (Lvdt, LoadCell)
"""Sensors whose noise, hum and bits are declared."""
Sensor = Lvdt | LoadCell | PositionSensor | VelocitySensor | ForceSensor
MEASURES: Mapping[type, str] = {
    PositionSensor: "position",
    VelocitySensor: "velocity",
    ForceSensor: "force",
    Lvdt: "position",
    LoadCell: "force",
}
"""Type of sensor → what it measures of its joint."""


def measures(component: object) -> str:
    """What a component measures: position, velocity or force; "" if it is no sensor."""
    return MEASURES.get(type(component), "")


class Transducer(NamedTuple):
    """What a sensor makes of its quantity. drift: a tick; delay: in ticks; share: of the way to its
    input that the lag goes in a tick."""

    neutral: bool
    gain: float
    offset: float
    drift: float
    delay: float
    share: float


class TransducerState(NamedTuple):
    """history: past values, a ring; memory: where the ring stands (−1 before the first tick), the
    lag's output, how far the zero has drifted."""

    history: Array
    memory: Array


def transducer(sensor: Sensor, period: float) -> Transducer:
    drift = sensor.drift * period
    own = sensor.gain, sensor.offset, sensor.delay, sensor.lag, drift
    neutral = own == (1.0, 0.0, 0.0, 0.0, 0.0)
    # A sensor that runs tick by tick cannot know what comes: see `apply_sensor` for a lead.
    lag, delay = max(sensor.lag, 0.0), max(sensor.delay, 0.0)
    share = 1.0 if lag == 0.0 else 1.0 - math.exp(-period / lag)
    return Transducer(neutral, sensor.gain, sensor.offset, drift, delay / period, share)


def start_transducer(sensor: Transducer) -> TransducerState:
    """Before the first sample."""
    return TransducerState(ring(sensor.delay, 0.0), np.array([-1.0, 0.0, 0.0]))


def remove_drift(sensor: Sensor, measured: Array, period: float) -> Array:
    """What a sensor reads, shape (ticks,), as if its zero had stayed where it was at the start."""
    if sensor.drift == 0.0:
        return measured
    return measured - sensor.drift * period * np.arange(len(measured))


@compilable
def transduce(sensor: Transducer, state: TransducerState, value: float) -> float:
    """The sensor's output at this tick. Before the first tick the quantity was what it is then."""
    if sensor.neutral:
        return value
    if state.memory[0] < 0.0:
        state.history[:] = value
        state.memory[0], state.memory[1] = 0.0, value
    late = delay_sample(state.history, state.memory, sensor.delay, value)
    state.memory[1] += sensor.share * (late - state.memory[1])
    found = sensor.gain * state.memory[1] + sensor.offset + state.memory[2]
    state.memory[2] += sensor.drift
    return found


@kernel
def _transduce_all(sensor: Transducer, state: TransducerState, true: Array, out: Array) -> None:
    for tick in range(len(true)):
        out[tick] = transduce(sensor, state, true[tick])


def apply_sensor(sensor: Sensor, true: Array, period: float) -> Array:
    """What a sensor makes of a signal, shape (ticks,), noise and quantisation apart."""
    model, out = transducer(sensor, period), np.empty(len(true))
    if model.neutral:
        return true.copy()
    ahead = _lead(-min(sensor.lag, 0.0), -min(sensor.delay, 0.0), true, period)
    _transduce_all(model, start_transducer(model), np.ascontiguousarray(ahead), out)
    return out


def _lead(lag: float, delay: float, signal: Array, period: float) -> Array:
    """Undo a lag, s, and a delay, s, of a signal, shape (ticks,).

    The lag's inverse is limited to 80 Hz, or it would make much of the noise.
    """
    ahead = signal
    if lag > 0.0 and len(signal) > PADDED:
        # Loading it takes a second, which most runs need not wait for.
        from scipy.signal import butter, sosfiltfilt

        low_pass = butter(2, min(INVERTIBLE, 0.4 / period), fs=1.0 / period, output="sos")
        ahead = signal + lag * np.gradient(sosfiltfilt(low_pass, signal), period)
    if delay > 0.0:
        ticks = np.arange(len(signal))
        ahead = np.interp(ticks + delay / period, ticks, ahead)
    return ahead


def undo_sensor(sensor: Sensor, signal: Array, period: float) -> Array:
    """The change of a true quantity behind a change of a sensor's output: its gain, lag and delay
    undone, not its offset."""
    return _lead(max(sensor.lag, 0.0), max(sensor.delay, 0.0), signal, period) / sensor.gain
