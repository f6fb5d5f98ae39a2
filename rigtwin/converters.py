"""Sensors and converters between the plant and the controller: white noise, mains hum with random phase, 16 bits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.arrays import Array
from rigtwin.parameters import LoadCell, Lvdt, Plant


def sensors(plant: Plant) -> tuple[Lvdt | LoadCell, ...]:
    """The plant's sensors in the order of Measurements."""
    return tuple(getattr(plant, name) for name in Measurements._fields)


def resolutions(plant: Plant) -> Measurements:
    """Size of one bit of each channel, in its unit."""
    return Measurements(*(sensor.resolution for sensor in sensors(plant)))


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


def transducer(sensor: Lvdt | LoadCell, period: float) -> Transducer:
    neutral = (sensor.gain, sensor.offset, sensor.delay, sensor.lag) == (1.0, 0.0, 0.0, 0.0)
    share = 1.0 if sensor.lag == 0.0 else 1.0 - math.exp(-period / sensor.lag)
    return Transducer(neutral, sensor.gain, sensor.offset, sensor.delay / period, share)


def sensing(plant: Plant, period: float) -> Sensing:
    """The plant's sensors before their first sample. period in s."""
    one, two, three, four = (transducer(sensor, period) for sensor in sensors(plant))
    fresh = [TransducerState(np.zeros(int(each.delay) + 3), np.array([-1.0, 0.0])) for each in (one, two, three, four)]
    return Sensing((one, two, three, four), (fresh[0], fresh[1], fresh[2], fresh[3]), resolutions(plant))


@compilable
def transduced(sensor: Transducer, state: TransducerState, value: float) -> float:
    """The sensor's output at this tick. Before the first tick the quantity was what it is then."""
    if sensor.neutral:
        return value
    if state.memory[0] < 0.0:
        state.history[:] = value
        state.memory[0], state.memory[1] = 0.0, value
    length = len(state.history)
    place = int(state.memory[0])
    state.history[place] = value
    whole = int(sensor.delay)
    part = sensor.delay - whole
    late = (1.0 - part) * state.history[(place - whole) % length] + part * state.history[(place - whole - 1) % length]
    state.memory[0] = (place + 1) % length
    state.memory[1] += sensor.share * (late - state.memory[1])
    return sensor.gain * state.memory[1] + sensor.offset


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
