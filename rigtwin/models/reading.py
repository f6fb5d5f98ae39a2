"""What disturbs the readings of a described machine's sensors: noise, hum and bits."""

from __future__ import annotations

import numpy as np

from rigtwin.components import measures
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array


def sensors_of(machine: Machine) -> list[str]:
    """The sensors that have a channel."""
    return [
        name
        for name, component in machine.components.items()
        if measures(getattr(machine.plant, name)) and component.channel is not None
    ]


def make_noise(
    plant: Plant, name: str, ticks: int, period: float, random: np.random.Generator
) -> Array:
    """What is added to a sensor's readings, shape (ticks,)."""
    hum = hum_of(plant, name, random.uniform(0.0, 2.0 * np.pi), period * np.arange(ticks))
    return getattr(plant, name).white * random.standard_normal(ticks) + hum


def hum_of(plant: Plant, name: str, phase: float, time: Array) -> Array:
    """The mains' hum in a sensor's readings at some times, s."""
    return getattr(plant, name).hum * np.sin(2.0 * np.pi * plant.mains.frequency * time + phase)


def round_reading(plant: Plant, name: str, reading: Array) -> Array:
    """A reading to the sensor's bit."""
    bit = getattr(plant, name).resolution
    return np.round(reading / bit) * bit if bit > 0.0 else reading
