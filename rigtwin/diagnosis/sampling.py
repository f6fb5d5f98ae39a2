"""Properties of sensors estimated from their signals alone: white noise, hum and bit.

A sensor of the resolution q rounds with the variance q^2 / 12. It is subtracted from the measured
noise, so that a coarse bit is not counted as noise as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant, parameter_of
from rigtwin.components.sensors import sensor_of
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import remove_mains, rms, smallest_step, white_noise

OUTSTANDING = 1.6
"""Ratio of a sensor's noise, hum or bit to its nominal value from which it is a finding. The ratio
must also exceed the median ratio of the other sensors by this factor: an excess that all sensors
share is noise of the laboratory, which is never declared exactly."""


@dataclass(frozen=True)
class SensorProperty:
    """Property of one sensor that differs from its nominal value.

    Attributes
    ----------
    component
        Name of the sensor.
    kind
        Kind of effect: noise, hum or quantisation.
    parameter
        Parameter of the sensor that has this property.
    value, nominal
        Estimated and nominal value, in the sensor's unit.
    """

    component: str
    kind: str
    parameter: str
    value: float
    nominal: float


PROPERTIES = {"white": "noise", "hum": "hum", "resolution": "quantisation"}
"""Parameter of a sensor → kind of effect whose magnitude it is."""


def properties(signal: Array, predicted: Array, period: float, mains: float) -> dict[str, float]:
    """Estimate the properties of one sensor.

    Parameters
    ----------
    signal, predicted
        Measured and predicted signal, in the sensor's unit, shape (ticks,).
    period
        Time from tick to tick, s.
    mains
        Frequency of the mains, Hz.

    Returns
    -------
    dict
        White noise rms, amplitude of the mains line and size of a bit, in the sensor's unit.
    """
    difference = signal - predicted
    line = difference - remove_mains(difference, period, mains)
    bit = smallest_step(signal)
    # A controller feeds the sensors' noise back to the machine. The prediction contains the motion
    # that follows, so that the residual may have less noise than the signal: the smaller counts.
    noise = min(white_noise(signal), white_noise(difference))
    # Rounding to a bit adds a variance of bit^2 / 12.
    white = math.sqrt(max(noise**2 - bit**2 / 12.0, 0.0))
    # The amplitude of a sine is sqrt(2) times its rms.
    return {"white": white, "hum": math.sqrt(2.0) * rms(line - np.mean(line)), "resolution": bit}


def find_outstanding(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    predicted: Sequence[Array],
    plant: Plant,
) -> tuple[SensorProperty, ...]:
    """Find sensor properties that exceed both their nominal values and those of other sensors.

    Sensors without declared noise are not judged.

    Parameters
    ----------
    machine
        Machine with the sensors. Effects that its description excludes are not reported.
    recordings
        Recordings of the machine.
    predicted
        Predicted signals, shape (rows, ticks) for each recording.
    plant
        Plant with the sensors' nominal properties.

    Returns
    -------
    tuple of SensorProperty
        Outstanding properties.
    """
    table = _properties_by_sensor(machine, recordings, predicted, plant)
    possible = {effect.name for effect in machine.effects()}
    outstanding: list[SensorProperty] = []
    for parameter, kind in PROPERTIES.items():
        nominal = {name: parameter_of(plant, name, parameter) for name in table}
        # A sensor whose nominal value is 0 cannot have this property.
        ratios = {
            name: values[parameter] / nominal[name] if nominal[name] > 0.0 else 0.0
            for name, values in table.items()
        }
        for name, ratio in ratios.items():
            if f"{kind}@{name}" not in possible:
                continue
            if _is_hidden(kind, table[name]):
                continue
            # A single sensor is compared with its nominal value alone.
            references = [value for key, value in ratios.items() if key != name] or [1.0]
            if ratio > OUTSTANDING * max(1.0, float(np.median(references))):
                value = table[name][parameter]
                outstanding.append(SensorProperty(name, kind, parameter, value, nominal[name]))
    return tuple(outstanding)


def _properties_by_sensor(
    machine: Machine, recordings: Sequence[RecordedTest], predicted: Sequence[Array], plant: Plant
) -> dict[str, dict[str, float]]:
    """Return the properties of each sensor with declared noise, over all recordings."""
    table: dict[str, dict[str, float]] = {}
    for number, row in enumerate(machine.rows):
        component = machine.components.get(row.name)
        if component is None or not component.quantity:
            continue
        if sensor_of(plant, row.name).white == 0.0:
            continue
        by_recording = [
            properties(r.column(*row.channel), rows[number], r.period, plant.mains.frequency)
            for r, rows in zip(recordings, predicted, strict=True)
        ]
        # The median over recordings ignores a single one that was disturbed.
        table[row.name] = {
            key: float(np.median([part[key] for part in by_recording])) for key in PROPERTIES
        }
    return table


def _is_hidden(kind: str, measured: dict[str, float]) -> bool:
    """Return whether a larger property of the same sensor hides the one of this kind."""
    # Only the larger of noise and bit is observable: noise hides a smaller bit, and a bit hides
    # smaller noise.
    if kind == "quantisation":
        return measured["resolution"] < measured["white"]
    if kind == "noise":
        return measured["resolution"] > measured["white"]
    # A hum smaller than the bit may appear as anything from 0 to one bit.
    return measured["resolution"] > measured["hum"]
