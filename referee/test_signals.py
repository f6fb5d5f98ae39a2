"""Tests of the referee's rig: imposed multisines, roads, a drop, and tests ended by a limit."""

from __future__ import annotations

import numpy as np

from referee.reference_rig import Law
from referee.reference_truth import Array

TESTS = ("imposed", "imposed", "imposed", "road10", "road1.6", "drop", "tripped")
"""Tests to draw from. Half of the full-length ones are imposed, and one in seven ends early."""
PROPOSED = ("imposed", "imposed-fast", "road10", "road1.6", "drop")
"""Tests that a diagnosis may propose, by its names."""
# Length of every test, s.
SECONDS = {
    "imposed": 20.0,
    "imposed-fast": 20.0,
    "road10": 20.0,
    "road1.6": 20.0,
    "drop": 12.0,
    "tripped": 6.0,
}


def _sines(
    time: Array, low: float, high: float, slope: float, rms: float, random: np.random.Generator
) -> Array:
    """Return a multisine with amplitudes ∝ f^−slope, lines every 0.1 Hz, faded in, shape (n,)."""
    frequency = np.arange(low, high, 0.1)
    size = frequency**-slope
    phase = random.uniform(0.0, 2.0 * np.pi, len(frequency))
    signal = (size * np.sin(2.0 * np.pi * np.outer(time, frequency) + phase)).sum(axis=1)
    return signal * rms / np.sqrt(0.5 * np.sum(size**2)) * _rise(time)


def _rise(time: Array) -> Array:
    """Return a fade-in over the first second."""
    return np.where(time < 1.0, 0.5 - 0.5 * np.cos(np.pi * time), 1.0)


def _road(time: Array, speed: float, low: float, high: float, random: np.random.Generator) -> Array:
    """Return a road profile of spectral density 7e-8 n^−2.5 m²/(cycle/m), m, shape (n,)."""
    # n = f/v is the wavenumber. A line of width Δn has the amplitude √(2 S(n) Δn).
    frequency = np.arange(low, high + low / 2, low)
    size = np.sqrt(2.0 * 7e-8 * (frequency / speed) ** -2.5 * low / speed)
    phase = random.uniform(0.0, 2.0 * np.pi, len(frequency))
    signal = np.zeros_like(time)
    for f, a, p in zip(frequency, size, phase, strict=True):
        signal += a * np.sin(2.0 * np.pi * f * time + p)
    # The road starts at height 0, where the wheel rests.
    return (signal - signal[0]) * _rise(time)


def draw_demands(test: str, random: np.random.Generator) -> tuple[Law, Array]:
    """Draw a test by its name: settings of the controller, and demands, shape (ticks, 3)."""
    time: Array = np.arange(round(SECONDS[test] / 1e-3), dtype=np.float64) * 1e-3
    demands = np.zeros((len(time), 3))
    if test in ("imposed", "tripped"):
        demands[:, 0] = _sines(time, 0.2, 10.0, 1.0, 0.005, random)
        demands[:, 1] = -0.004 + _sines(time, 0.2, 10.0, 1.0, 0.009, random)
        demands[:, 2] = 230.0 + _sines(time, 0.3, 30.0, 0.5, 35.0, random)
        if test == "tripped":
            # The demanded position diverges, so the limit of the structure plate ends the test.
            demands[:, 1] += 0.2 * np.maximum(time - random.uniform(1.8, 2.4), 0.0) ** 2
        return Law(), demands
    if test == "imposed-fast":
        demands[:, 0] = _sines(time, 0.2, 10.0, 0.5, 0.0025, random)
        demands[:, 1] = -0.004 + _sines(time, 0.2, 20.0, 0.5, 0.004, random)
        demands[:, 2] = 230.0 + _sines(time, 0.5, 20.0, 0.5, 20.0, random)
        demands[:, 2] += _sines(time, 20.0, 120.0, 0.0, 45.0, random)
        return Law(), demands
    if test == "road10":
        demands[:, 0] = _road(time, 15.0 / 3.6, 0.05, 10.0, random)
    if test == "road1.6":
        demands[:, 0] = _road(time, 25.0 / 3.6, 0.02, 1.6, random)
    return Law(imposed=False), demands
