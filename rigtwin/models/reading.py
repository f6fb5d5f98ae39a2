"""Imperfections of a described machine's sensors: white noise, mains hum and quantisation."""

from __future__ import annotations

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array


def sensors_of(machine: Machine) -> list[str]:
    """Return the names of all sensors that have a channel."""
    return [
        name
        for name, component in machine.components.items()
        if component.quantity and component.channel is not None
    ]


def make_noise(
    plant: Plant, name: str, ticks: int, period: float, random: np.random.Generator
) -> Array:
    """Return noise and hum of a sensor in its unit, shape (ticks,).

    Parameters
    ----------
    plant
        Components of the machine.
    name
        Name of the sensor.
    ticks
        Number of ticks of the test.
    period
        Time from tick to tick, s.
    random
        Generator of the noise and of the hum's phase.

    Returns
    -------
    array
        Signal that adds to the reading, shape (ticks,).
    """
    # The order of the draws, phase first, keeps recordings of a seed the same.
    hum = hum_of(plant, name, random.uniform(0.0, 2.0 * np.pi), period * np.arange(ticks))
    return sensor_of(plant, name).white * random.standard_normal(ticks) + hum


def hum_of(plant: Plant, name: str, phase: float, time: Array) -> Array:
    """Return the mains hum of a sensor at times in s: hum·sin(2π·f·time + phase)."""
    return sensor_of(plant, name).hum * np.sin(2.0 * np.pi * plant.mains.frequency * time + phase)


def round_reading(plant: Plant, name: str, reading: Array) -> Array:
    """Return a reading rounded to the resolution of the sensor."""
    bit = sensor_of(plant, name).resolution
    return np.round(reading / bit) * bit if bit > 0.0 else reading
