"""What the signals themselves say of their sensors: white noise, mains line, size of one bit. No
model is needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import LoadCell, Lvdt
from rigtwin.components.plant import Plant
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms, smallest_step, white_noise, without_mains

OUTSTANDING = 1.6
"""Times its nominal value, and times what the other sensors have more than nominal, from which a
sensor's noise, hum or bit is a finding. What all sensors have more is the laboratory's noise, which
nobody declares exactly."""
LEVELS = 64
"""A signal with fewer values than these per swing is coarse enough for its bits to matter."""


@dataclass(frozen=True)
class SensorProperty:
    """One property of one sensor. kind: noise, hum or quantisation; parameter: its name; value,
    nominal: in the sensor's unit."""

    component: str
    kind: str
    parameter: str
    value: float
    nominal: float


def properties(recording: Recording, name: str, predicted: Array, plant: Plant) -> dict[str, float]:
    """White noise rms, mains amplitude and bit of one sensor. predicted: what a twin says it should
    read."""
    signal = recording.column("/sensor", name)
    difference = signal - predicted
    line = difference - without_mains(difference, recording.period, plant.mains.frequency)
    bit = smallest_step(signal)
    # White noise as the bits leave it: a coarse bit adds a variance of its own.
    white = math.sqrt(max(white_noise(signal) ** 2 - bit**2 / 12.0, 0.0))
    return {"white": white, "hum": math.sqrt(2.0) * rms(line - np.mean(line)), "resolution": bit}


def find_outstanding(
    sensors: Sequence[str],
    recordings: Sequence[Recording],
    predicted: Sequence[Sequence[Array]],
    plant: Plant,
) -> tuple[SensorProperty, ...]:
    """What stands out of nominal, and of what the other sensors have, of those whose noise is
    declared. sensors: names in the order of the rows of predicted: one list a recording, one array
    a sensor."""
    declared = [name for name in sensors if getattr(getattr(plant, name, None), "white", 0.0) > 0.0]
    if not declared:
        return ()
    names = {"white": "noise", "hum": "hum", "resolution": "quantisation"}
    found: list[SensorProperty] = []
    table: dict[str, dict[str, float]] = {}
    for number, name in enumerate(sensors):
        if name not in declared:
            continue
        each = [
            properties(r, name, p[number], plant)
            for r, p in zip(recordings, predicted, strict=True)
        ]
        table[name] = {key: float(np.median([one[key] for one in each])) for key in names}
    for parameter, kind in names.items():
        ratios: dict[str, float] = {}
        for name in declared:
            sensor: Lvdt | LoadCell = getattr(plant, name)
            nominal = float(getattr(sensor, parameter))
            # Hum is seen above what white noise alone would show of a line.
            ratios[name] = table[name][parameter] / nominal if nominal > 0.0 else 0.0
        for name, ratio in ratios.items():
            others = [other for key, other in ratios.items() if key != name]
            if kind == "quantisation" and table[name]["resolution"] < table[name]["white"]:
                continue
            if kind == "noise" and table[name]["resolution"] > table[name]["white"]:
                continue
            if ratio > OUTSTANDING and ratio > OUTSTANDING * float(np.median(others)):
                nominal = float(getattr(getattr(plant, name), parameter))
                found.append(SensorProperty(name, kind, parameter, table[name][parameter], nominal))
    return tuple(found)
