"""Sensors and converters between the plant and the controller: white noise, mains hum with random phase, 16 bits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components.parameters import LoadCell, Lvdt, Plant
from rigtwin.components.parts import ForceSensor, PositionSensor, VelocitySensor
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delayed, ring

Sensor = Lvdt | LoadCell | PositionSensor | VelocitySensor | ForceSensor


def sensors(plant: Plant) -> tuple[Lvdt | LoadCell, ...]:
    """The plant's sensors in the order of Measurements."""
    return tuple(getattr(plant, name) for name in Measurements._fields)


def resolutions(plant: Plant) -> Measurements:
    """Size of one bit of each channel, in its unit."""
    return Measurements(*(sensor.resolution for sensor in sensors(plant)))


INVERTIBLE = 80.0
"""Hz, up to which a sensor's lag is undone."""
PADDED = 50
"""Samples that a zero-phase filter needs."""


class Transducer(NamedTuple):
    """What a sensor makes of its quantity. delay: in ticks; share: of the way to its input that the lag goes in a tick."""

    neutral: bool
    gain: float
    offset: float
    delay: float
    share: float


class TransducerState(NamedTuple):
    """history: past values, a ring; memory: where the ring stands (−1 before the first tick), the lag's output."""

    history: Array
    memory: Array


class Sensing(NamedTuple):
    """All transducers in the order of Measurements, and the size of one bit of each channel in its unit."""

    transducers: tuple[Transducer, Transducer, Transducer, Transducer]
    states: tuple[TransducerState, TransducerState, TransducerState, TransducerState]
    resolution: Measurements


def transducer(sensor: Sensor, period: float) -> Transducer:
    neutral = (sensor.gain, sensor.offset, sensor.delay, sensor.lag) == (1.0, 0.0, 0.0, 0.0)
    share = 1.0 if sensor.lag == 0.0 else 1.0 - math.exp(-period / sensor.lag)
    return Transducer(neutral, sensor.gain, sensor.offset, sensor.delay / period, share)


def sensing(plant: Plant, period: float) -> Sensing:
    """The plant's sensors before their first sample. period in s."""
    one, two, three, four = (transducer(sensor, period) for sensor in sensors(plant))
    return Sensing((one, two, three, four), (fresh(one), fresh(two), fresh(three), fresh(four)), resolutions(plant))


def fresh(sensor: Transducer) -> TransducerState:
    """Before the first sample."""
    return TransducerState(ring(sensor.delay, 0.0), np.array([-1.0, 0.0]))


@compilable
def transduced(sensor: Transducer, state: TransducerState, value: float) -> float:
    """The sensor's output at this tick. Before the first tick the quantity was what it is then."""
    if sensor.neutral:
        return value
    if state.memory[0] < 0.0:
        state.history[:] = value
        state.memory[0], state.memory[1] = 0.0, value
    late = delayed(state.history, state.memory, sensor.delay, value)
    state.memory[1] += sensor.share * (late - state.memory[1])
    return sensor.gain * state.memory[1] + sensor.offset


@kernel
def _seen(sensor: Transducer, state: TransducerState, true: Array, out: Array) -> None:
    for tick in range(len(true)):
        out[tick] = transduced(sensor, state, true[tick])


def seen(sensor: Sensor, true: Array, period: float) -> Array:
    """What a sensor makes of a signal, shape (ticks,), noise and quantisation apart."""
    model, out = transducer(sensor, period), np.empty(len(true))
    if model.neutral:
        return true.copy()
    _seen(model, fresh(model), np.ascontiguousarray(true), out)
    return out


def unseen(sensor: Sensor, signal: Array, period: float) -> Array:
    """The change of a true quantity behind a change of a sensor's output: its gain, lag and delay undone, not its offset.

    The lag's inverse is limited to 80 Hz, or it would make much of the noise.
    """
    lagged = signal
    if sensor.lag > 0.0 and len(signal) > PADDED:
        smooth = sosfiltfilt(butter(2, min(INVERTIBLE, 0.4 / period), fs=1.0 / period, output="sos"), signal)
        lagged = signal + sensor.lag * np.gradient(smooth, period)
    ticks = np.arange(len(signal))
    early = np.interp(ticks + sensor.delay / period, ticks, lagged) if sensor.delay > 0.0 else lagged
    return early / sensor.gain


class Disturbance:
    """Noise and hum of all sensors, one tick after another, from a seed.

    Every channel draws from a stream of its own, so that changing one leaves the others as they were, and the numbers do
    not depend on how many ticks are asked for at a time.
    """

    def __init__(self, plant: Plant, period: float, seed: int) -> None:
        self._sensors = sensors(plant)
        self._radians = 2 * math.pi * plant.mains.frequency * period
        self._streams = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(len(self._sensors))]
        self._phases = [stream.uniform(0.0, 2 * math.pi) for stream in self._streams]
        self._tick = 0

    def take(self, ticks: int) -> Array:
        """The next ticks' disturbances, shape (ticks, 4), in the channels' units."""
        time = np.arange(self._tick, self._tick + ticks)
        self._tick += ticks
        columns = [
            sensor.white * stream.standard_normal(ticks) + sensor.hum * np.sin(self._radians * time + phase)
            for sensor, stream, phase in zip(self._sensors, self._streams, self._phases, strict=True)
        ]
        return np.column_stack(columns)


@compilable
def converted(value: float, disturbance: float, resolution: float) -> float:
    """One sample as the DAQ delivers it."""
    raw = value + disturbance
    if resolution > 0.0:
        return round(raw / resolution) * resolution
    return raw


@compilable
def sampled(sensing: Sensing, true: Measurements, disturbance: Array) -> Measurements:
    """All samples of one tick; disturbance has shape (4,). Advances the sensors' states."""
    sensors, states, bits = sensing.transducers, sensing.states, sensing.resolution
    return Measurements(
        converted(transduced(sensors[0], states[0], true.ground_lvdt), disturbance[0], bits.ground_lvdt),
        converted(transduced(sensors[1], states[1], true.structure_lvdt), disturbance[1], bits.structure_lvdt),
        converted(transduced(sensors[2], states[2], true.suspension_lvdt), disturbance[2], bits.suspension_lvdt),
        converted(transduced(sensors[3], states[3], true.load_cell), disturbance[3], bits.load_cell),
    )
