"""What the signals themselves say of their sensors: white noise, mains line, size of one bit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import measures
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import remove_mains, rms, smallest_step, white_noise

OUTSTANDING = 1.6
"""Times its nominal value, and times what the other sensors have more than nominal, from which a
sensor's noise, hum or bit is a finding. What all sensors have more is the laboratory's noise, which
nobody declares exactly."""


@dataclass(frozen=True)
class SensorProperty:
    """One property of one sensor. kind: noise, hum or quantisation; parameter: its name; value,
    nominal: in the sensor's unit."""

    component: str
    kind: str
    parameter: str
    value: float
    nominal: float


PROPERTIES = {"white": "noise", "hum": "hum", "resolution": "quantisation"}
"""Parameter of a sensor → the kind of effect that it is the magnitude of."""


def properties(signal: Array, predicted: Array, period: float, mains: float) -> dict[str, float]:
    """What a sensor shows by itself.

    Parameters
    ----------
    signal, predicted
        What it read, and what a twin says that it should
    read, shape (ticks,), in its unit.
    period
        s, of a tick.
    mains
        Hz.

    Returns
    -------
    White noise rms, amplitude of the mains line and size of a bit, in its unit.
    """
    difference = signal - predicted
    line = difference - remove_mains(difference, period, mains)
    bit = smallest_step(signal)
    # What a controller makes of its sensors' noise shakes the machine, and is no noise of theirs.
    noise = min(white_noise(signal), white_noise(difference))
    # White noise as the bits leave it: a coarse bit adds a variance of its own.
    white = math.sqrt(max(noise**2 - bit**2 / 12.0, 0.0))
    return {"white": white, "hum": math.sqrt(2.0) * rms(line - np.mean(line)), "resolution": bit}


def find_outstanding(
    machine: Machine,
    recordings: Sequence[Recording],
    predicted: Sequence[Array],
    plant: Plant,
) -> tuple[SensorProperty, ...]:
    """What stands out of nominal, and of what the other sensors have, where noise is
    declared.

    Parameters
    ----------
    machine
        Whose sensors they are; what its description says a sensor cannot have is left out.
    recordings
        Of it.
    predicted
        What a twin says that its rows should be, shape (rows, ticks) for each recording.
    plant
        With the sensors' nominal properties.
    """
    table: dict[str, dict[str, float]] = {}
    for number, row in enumerate(machine.rows):
        sensor = getattr(plant, row.name, None)
        if sensor is None or not measures(sensor) or sensor.white == 0.0:
            continue
        each = [
            properties(r.column(*row.channel), rows[number], r.period, plant.mains.frequency)
            for r, rows in zip(recordings, predicted, strict=True)
        ]
        table[row.name] = {key: float(np.median([one[key] for one in each])) for key in PROPERTIES}
    possible = {effect.name for effect in machine.effects()}
    found: list[SensorProperty] = []
    for parameter, kind in PROPERTIES.items():
        nominal = {name: float(getattr(getattr(plant, name), parameter)) for name in table}
        # Hum is seen above what white noise alone would show of a line.
        ratios = {
            name: values[parameter] / nominal[name] if nominal[name] > 0.0 else 0.0
            for name, values in table.items()
        }
        for name, ratio in ratios.items():
            if f"{kind}@{name}" not in possible:
                continue
            if kind == "quantisation" and table[name]["resolution"] < table[name]["white"]:
                continue
            if kind == "noise" and table[name]["resolution"] > table[name]["white"]:
                continue
            # A line within one bit reads as anything up to the bit, by where the signal stands.
            if kind == "hum" and table[name]["resolution"] > table[name]["hum"]:
                continue
            # Without another sensor there is nothing that says what the laboratory has more.
            others = [other for key, other in ratios.items() if key != name] or [1.0]
            if ratio > OUTSTANDING * max(1.0, float(np.median(others))):
                value = table[name][parameter]
                found.append(SensorProperty(name, kind, parameter, value, nominal[name]))
    return tuple(found)
