"""Sensors of the wild referee's machines."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from referee.wild_truth import Array


@dataclass(frozen=True)
class SensorTruth:
    """Sensor and logger; units are those of the signal.

    Attributes
    ----------
    noise : float
        White noise, rms.
    coloured, corner : float
        Low-frequency noise, rms, and its corner frequency, Hz.
    bit : float
        Resolution.
    eccentric, pitch : float
        Amplitude of an encoder's periodic error as a share of its pitch, and the pitch.
    delay : float
        Delay of the channel, s.
    """

    noise: float = 0.0
    coloured: float = 0.0
    corner: float = 2.0
    bit: float = 0.0
    eccentric: float = 0.0
    pitch: float = 0.1
    delay: float = 0.0


def read_sensor(
    random: np.random.Generator, signal: Array, sensor: SensorTruth, period: float
) -> Array:
    """Return the readings of a sensor and its logger, in the unit of the signal."""
    ticks = np.arange(len(signal))
    # Delay first: eccentricity and noise are those of the delayed sample.
    reading = np.interp(ticks - sensor.delay / period, ticks, signal)
    reading = reading + sensor.eccentric * sensor.pitch * np.sin(
        2.0 * math.pi * reading / sensor.pitch
    )
    reading = (
        reading
        + sensor.noise * random.standard_normal(len(signal))
        + _coloured_noise(random, sensor, len(ticks), period)
    )
    return np.round(reading / sensor.bit) * sensor.bit if sensor.bit > 0.0 else reading


def _coloured_noise(
    random: np.random.Generator, sensor: SensorTruth, count: int, period: float
) -> Array:
    """Return noise below a corner frequency, in the unit of the sensor."""
    if sensor.coloured == 0.0:
        return np.zeros(count)
    # Shaped in the frequency domain, and scaled to the stated rms afterwards.
    white = np.fft.rfft(random.standard_normal(count))
    frequency = np.fft.rfftfreq(count, period)
    fade_speed = np.fft.irfft(white / (1.0 + (frequency / sensor.corner) ** 2), count)
    return sensor.coloured * fade_speed / float(np.std(fade_speed))
