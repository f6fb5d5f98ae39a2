"""Sensors and converters between the plant and the controller: white noise, mains hum with random phase, 16 bits."""

from __future__ import annotations

import math

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
def sampled(true: Measurements, disturbance: Array, resolution: Measurements) -> Measurements:
    """All samples of one tick; disturbance has shape (4,)."""
    return Measurements(
        converted(true.ground_lvdt, disturbance[0], resolution.ground_lvdt),
        converted(true.structure_lvdt, disturbance[1], resolution.structure_lvdt),
        converted(true.suspension_lvdt, disturbance[2], resolution.suspension_lvdt),
        converted(true.load_cell, disturbance[3], resolution.load_cell),
    )
