"""Sensors and analogue-to-digital converters of the suspension rig's twin.

reading = round((transduced + noise + hum)/bit)·bit, with white noise and mains hum of random phase.
"""

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
    """Return the plant's sensors in the order of `Measurements`."""
    return plant.ground_lvdt, plant.structure_lvdt, plant.suspension_lvdt, plant.load_cell


def resolutions(plant: RigPlant) -> Measurements:
    """Return the size of one bit of each channel, in its unit."""
    return Measurements(*(sensor.resolution for sensor in sensors(plant)))


class Sensing(NamedTuple):
    """Sensors and converters as compiled code takes them, in the order of `Measurements`."""

    # Numba needs tuples of known length, hence four by name.
    transducers: tuple[Transducer, Transducer, Transducer, Transducer]
    states: tuple[TransducerState, TransducerState, TransducerState, TransducerState]
    resolution: Measurements  # Size of one bit of each channel, in its unit.


def build_sensing(plant: RigPlant, period: float) -> Sensing:
    """Return the plant's sensors before their first sample, for ticks of a period, s."""
    ground, structure, suspension, load_cell = (
        transducer(sensor, period) for sensor in sensors(plant)
    )
    return Sensing(
        (ground, structure, suspension, load_cell),
        (
            start_transducer(ground),
            start_transducer(structure),
            start_transducer(suspension),
            start_transducer(load_cell),
        ),
        resolutions(plant),
    )


class Disturbance:
    """Noise and hum of all sensors, tick by tick, from a seed.

    Parameters
    ----------
    plant
        Parameters of the rig.
    period
        Time from tick to tick, s.
    seed
        Seed of the noise and of the hum's phases.
    """

    def __init__(self, plant: RigPlant, period: float, seed: int) -> None:
        # Each channel draws from its own random stream. A change of one channel then leaves the
        # others' noise unchanged, and the numbers do not depend on the block size.
        self._sensors = sensors(plant)
        self._radians = 2 * math.pi * plant.mains.frequency * period
        self._streams = [
            np.random.default_rng(child)
            for child in np.random.SeedSequence(seed).spawn(len(self._sensors))
        ]
        self._phases = [stream.uniform(0.0, 2 * math.pi) for stream in self._streams]
        self._tick = 0

    def change(self, plant: RigPlant) -> None:
        """Continue with the noise levels of another plant."""
        self._sensors = sensors(plant)

    def take(self, ticks: int) -> Array:
        """Return noise and hum of the next ticks, in the channels' units, shape (ticks, 4)."""
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
    """Return a sample as the converter delivers it: round((value + disturbance)/bit)·bit."""
    raw = value + disturbance
    if resolution > 0.0:
        return round(raw / resolution) * resolution
    return raw


@compilable
def sample_sensors(sensing: Sensing, true: Measurements, disturbance: Array) -> Measurements:
    """Return all samples of one tick and advance the sensors' states.

    `disturbance` is the noise and hum of this tick, in the channels' units, shape (4,).
    """

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
