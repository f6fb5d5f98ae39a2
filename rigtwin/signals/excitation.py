"""Excitation of tests: pseudo-random roads and multisines, with phases from a seed."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from rigtwin.description.settings import Road
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.system import count_cores

AT_ONCE = 8192
"""Number of samples that fit into a core's cache."""
FADE = 1.0
"""Time over which an excitation grows from zero, in s, so that the rig starts at rest."""


def fade_in(time: Array, seconds: float = FADE) -> Array:
    """Return a raised cosine from 0 at the start to 1 after `seconds`, without jumps in slope."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(time / seconds, 0.0, 1.0))


def sum_of_sines(time: Array, frequencies: Array, amplitudes: Array, phases: Array) -> Array:
    """Return Σ amplitude·sin(2π·frequency·time + phase).

    Frequencies are in Hz, phases in rad. Long sums are computed on all cores. The result does not
    depend on the number of cores, because each part is summed in the same order.
    """
    total = np.zeros_like(time)
    sines = list(zip(frequencies.tolist(), amplitudes.tolist(), phases.tolist(), strict=True))

    def add(first: int) -> None:
        part = slice(first, first + AT_ONCE)
        times = time[part]
        for frequency, amplitude, phase in sines:
            total[part] += amplitude * np.sin(2 * math.pi * frequency * times + phase)

    parts = range(0, len(time), AT_ONCE)
    if len(parts) == 1:
        add(0)
    else:
        with ThreadPoolExecutor(count_cores()) as workers:
            list(workers.map(add, parts))
    return total


def road_spectrum(road: Road) -> tuple[Array, Array]:
    """Return frequencies, in Hz, and amplitudes, in m, of a road's sines.

    The amplitudes are sqrt(2·S(f/v)·Δf/v) with the spectral density S(γ) = k/γⁿ (thesis Eq. 6.3).

    Raises
    ------
    RigtwinError
        If the band is empty.
    """
    if road.highest < road.lowest:
        raise RigtwinError(
            f"road.highest = {road.highest:g} Hz is below road.lowest = {road.lowest:g} Hz"
        )
    # The small term keeps the last frequency, which rounding might push beyond the band.
    count = int((road.highest - road.lowest) / road.spacing + 1e-9) + 1
    frequencies = road.lowest + road.spacing * np.arange(count)
    density = road.roughness / (frequencies / road.speed) ** road.exponent
    return frequencies, np.sqrt(2 * density * road.spacing / road.speed)


def road_profile(road: Road, time: Array, random: np.random.Generator) -> Array:
    """Return the ground position in m over `time` in s, with random phases.

    The position is relative to its start, because the cylinder starts at zero. It is faded in over
    the first second.
    """
    frequencies, amplitudes = road_spectrum(road)
    phases = random.uniform(0.0, 2 * math.pi, len(frequencies))
    profile = sum_of_sines(time, frequencies, amplitudes, phases)
    return fade_in(time) * (profile - profile[0])


def multisine(
    time: Array,
    lowest: float,
    highest: float,
    spacing: float,
    slope: float,
    rms: float,
    random: np.random.Generator,
) -> Array:
    """Return a random-phase multisine, faded in over the first second.

    Parameters
    ----------
    time : Array
        Times in s, shape (ticks,).
    lowest, highest, spacing : float
        Lowest and highest frequency and their spacing, in Hz.
    slope : float
        Exponent of the spectrum: amplitudes fall with frequency^-slope.
    rms : float
        RMS before fading, in the unit of the result.
    random : Generator
        Generator of the phases.

    Returns
    -------
    Array
        Signal, shape (ticks,).
    """
    frequencies = np.arange(lowest, highest + spacing / 2, spacing)
    amplitudes = frequencies**-slope
    # A sine of amplitude A has the mean square A²/2.
    amplitudes *= rms / math.sqrt(0.5 * np.sum(amplitudes**2))
    phases = random.uniform(0.0, 2 * math.pi, len(frequencies))
    return fade_in(time) * sum_of_sines(time, frequencies, amplitudes, phases)


def schroeder(time: Array, frequencies: Array, amplitude: float) -> Array:
    """Return sines of equal amplitudes with Schroeder phases −π·k·(k−1)/n (thesis §6.1.2)."""
    number = np.arange(1, len(frequencies) + 1)
    phases = -math.pi * number * (number - 1) / len(frequencies)
    return sum_of_sines(time, frequencies, np.full(len(frequencies), amplitude), phases)
