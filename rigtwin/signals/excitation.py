"""What excites a test: pseudo-random roads and multisines.

Sums of sines whose phases come from a seed.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from rigtwin.description.settings import Road
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.system import count_cores

AT_ONCE = 8192
"""Samples that stay in a core's cache."""
FADE = 1.0
"""Seconds over which an excitation grows from nothing, so that the rig starts at rest."""


def fade_in(time: Array, seconds: float = FADE) -> Array:
    """Raised cosine from 0 at the start to 1 after `seconds`; its slope starts and ends at 0."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(time / seconds, 0.0, 1.0))


def sum_of_sines(time: Array, frequencies: Array, amplitudes: Array, phases: Array) -> Array:
    """Σ amplitude·sin(2π·frequency·time + phase); frequencies Hz, phases rad.

    Long ones are worked out on all cores; the numbers are the same on any.
    """
    total = np.zeros_like(time)
    sines = list(zip(frequencies.tolist(), amplitudes.tolist(), phases.tolist(), strict=True))

    def add(first: int) -> None:
        part = slice(first, first + AT_ONCE)
        here = time[part]
        for frequency, amplitude, phase in sines:
            total[part] += amplitude * np.sin(2 * math.pi * frequency * here + phase)

    parts = range(0, len(time), AT_ONCE)
    if len(parts) == 1:
        add(0)
    else:
        with ThreadPoolExecutor(count_cores()) as workers:
            list(workers.map(add, parts))
    return total


def road_spectrum(road: Road) -> tuple[Array, Array]:
    """Frequencies (Hz) and amplitudes (m) of the road's sines.

    Sqrt(2·S(f/v)·Δf/v), S(γ) = k/γⁿ (thesis Eq. 6.3).

    Raises RigtwinError if the band is empty.
    """
    if road.highest < road.lowest:
        raise RigtwinError(
            f"road.highest = {road.highest:g} Hz is below road.lowest = {road.lowest:g} Hz"
        )
    count = int((road.highest - road.lowest) / road.spacing + 1e-9) + 1
    frequencies = road.lowest + road.spacing * np.arange(count)
    density = road.roughness / (frequencies / road.speed) ** road.exponent
    return frequencies, np.sqrt(2 * density * road.spacing / road.speed)


def road_profile(road: Road, time: Array, random: np.random.Generator) -> Array:
    """Ground position in m over `time` (s), with random phases.

    Measured from where it starts, since the cylinder starts at its zero, and faded in over the
    first second.
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
    """Makes a random-phase multisine, faded in over the first second.

    Parameters
    ----------
    time : Array
        s, shape (ticks,).
    lowest, highest, spacing : float
        Of its frequencies, Hz.
    slope : float
        Amplitudes fall with frequency^-slope.
    rms : float
        Before the fading, in the unit that is wanted.
    random : Generator
        Draws the phases.

    Returns
    -------
    Array
        Shape (ticks,).
    """
    frequencies = np.arange(lowest, highest + spacing / 2, spacing)
    amplitudes = frequencies**-slope
    amplitudes *= rms / math.sqrt(0.5 * np.sum(amplitudes**2))
    phases = random.uniform(0.0, 2 * math.pi, len(frequencies))
    return fade_in(time) * sum_of_sines(time, frequencies, amplitudes, phases)


def schroeder(time: Array, frequencies: Array, amplitude: float) -> Array:
    """Sines of equal amplitudes with Schroeder's phases −π·k·(k−1)/n (thesis §6.1.2)."""
    number = np.arange(1, len(frequencies) + 1)
    phases = -math.pi * number * (number - 1) / len(frequencies)
    return sum_of_sines(time, frequencies, np.full(len(frequencies), amplitude), phases)
