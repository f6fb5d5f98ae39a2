"""Sensors and converters between the plant and the controller: white noise, mains hum with random
phase, 16 bits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components import LoadCell, Lvdt, RigPlant
from rigtwin.components.sensors import (
    Transducer,
    TransducerState,
    start_transducer,
    transduce,
    transducer,
)
from rigtwin.numerics.arrays import Array


def sensors(plant: RigPlant) -> tuple[Lvdt | LoadCell, ...]:
    """The plant's sensors in the order of Measurements."""
    return tuple(getattr(plant, name) for name in Measurements._fields)


def resolutions(plant: RigPlant) -> Measurements:
    """Size of one bit of each channel, in its unit."""
    return Measurements(*(sensor.resolution for sensor in sensors(plant)))


class Sensing(NamedTuple):
    """All transducers in the order of Measurements, and the size of one bit of each channel in its
    unit."""

    transducers: tuple[Transducer, Transducer, Transducer, Transducer]
    states: tuple[TransducerState, TransducerState, TransducerState, TransducerState]
    resolution: Measurements


def build_sensing(plant: RigPlant, period: float) -> Sensing:
    """The plant's sensors before their first sample. period in s."""
    one, two, three, four = (transducer(sensor, period) for sensor in sensors(plant))
    return Sensing(
        (one, two, three, four),
        (
            start_transducer(one),
            start_transducer(two),
            start_transducer(three),
            start_transducer(four),
        ),
        resolutions(plant),
    )


class Disturbance:
    """Noise and hum of all sensors, one tick after another, from a seed.

    Every channel draws from a stream of its own, so that changing one leaves the others as they
    were, and the numbers do not depend on how many ticks are asked for at a time.
    """

    def __init__(self, plant: RigPlant, period: float, seed: int) -> None:
        self._sensors = sensors(plant)
        self._radians = 2 * math.pi * plant.mains.frequency * period
        self._streams = [
            np.random.default_rng(child)
            for child in np.random.SeedSequence(seed).spawn(len(self._sensors))
        ]
        self._phases = [stream.uniform(0.0, 2 * math.pi) for stream in self._streams]
        self._tick = 0

    def change(self, plant: RigPlant) -> None:
        """Goes on with another plant's sensors."""
        self._sensors = sensors(plant)

    def take(self, ticks: int) -> Array:
        """The next ticks' disturbances, shape (ticks, 4), in the channels' units."""
        time = np.arange(self._tick, self._tick + ticks)
        self._tick += ticks
        columns = [
            sensor.white * stream.standard_normal(ticks)
            + sensor.hum * np.sin(self._radians * time + phase)
            for sensor, stream, phase in zip(
                self._sensors, self._streams, self._phases, strict=True
            )
        ]
        return np.column_stack(columns)


@compilable
def quantise(value: float, disturbance: float, resolution: float) -> float:
    """One sample as the DAQ delivers it."""
    raw = value + disturbance
    if resolution > 0.0:
        return round(raw / resolution) * resolution
    return raw


@compilable
def sample_sensors(sensing: Sensing, true: Measurements, disturbance: Array) -> Measurements:
    """All samples of one tick; disturbance has shape (4,). Advances the sensors' states."""
    sensors, states, bits = sensing.transducers, sensing.states, sensing.resolution
    return Measurements(
        quantise(
            transduce(sensors[0], states[0], true.ground_lvdt), disturbance[0], bits.ground_lvdt
        ),
        quantise(
            transduce(sensors[1], states[1], true.structure_lvdt),
            disturbance[1],
            bits.structure_lvdt,
        ),
        quantise(
            transduce(sensors[2], states[2], true.suspension_lvdt),
            disturbance[2],
            bits.suspension_lvdt,
        ),
        quantise(transduce(sensors[3], states[3], true.load_cell), disturbance[3], bits.load_cell),
    )
