"""Roads and multisines against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.description.settings import Road
from rigtwin.errors import RigtwinError
from rigtwin.signals.excitation import (
    fade_in,
    multisine,
    road_profile,
    road_spectrum,
    schroeder,
    sum_of_sines,
)

TIME = np.arange(45_000) * 1e-3


def test_road_amplitudes_follow_equation_6_3():
    road = Road(speed=25 / 3.6, lowest=0.02, highest=1.6, spacing=0.02)
    frequencies, amplitudes = road_spectrum(road)
    assert (frequencies[0], frequencies[-1], len(frequencies)) == (0.02, pytest.approx(1.6), 80)
    wavenumber = frequencies / road.speed
    assert amplitudes == pytest.approx(np.sqrt(2 * 7e-8 / wavenumber**2.5 * 0.02 / road.speed))
    # The same road, 0.02 and 0.2 Hz lowest: 17.7 and 3.0 mm rms as recomputed in the facts of the
    # rig.
    assert np.sqrt(0.5 * np.sum(amplitudes**2)) == pytest.approx(0.0245, abs=0.001)


def test_road_starts_at_rest_and_repeats_with_its_seed():
    road = Road()
    first, repeated, different = (
        road_profile(road, TIME, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first[0] == 0.0
    assert abs(first[1] - first[0]) < 1e-6
    assert np.array_equal(first, repeated)
    assert not np.array_equal(first, different)
    with pytest.raises(RigtwinError, match="below"):
        road_spectrum(Road(lowest=2.0, highest=1.0))


def test_multisine_has_the_rms_asked_for():
    signal = multisine(TIME, 0.2, 10.0, 0.1, 1.0, 0.005, np.random.default_rng(0))
    assert np.sqrt(np.mean(signal[5000:] ** 2)) == pytest.approx(0.005, rel=0.01)
    assert signal[0] == 0.0


def test_schroeder_phases_keep_the_peak_low():
    frequencies = np.arange(1.0, 101.0)
    signal = schroeder(TIME[:1000], frequencies, 1.0)
    assert np.max(np.abs(signal)) < 2.0 * np.sqrt(np.mean(signal**2))
    assert np.abs(np.fft.rfft(signal))[1:101] * 2 / 1000 == pytest.approx(np.ones(100), abs=1e-9)


def test_fade_in():
    assert fade_in(np.array([0.0, 0.5, 1.0, 2.0])) == pytest.approx([0.0, 0.5, 1.0, 1.0])


def test_a_long_sum_of_sines_is_the_sum_term_by_term():
    """To the last digit, on however many cores: recordings are made of it."""
    random = np.random.default_rng(5)
    time = 1e-3 * np.arange(30_011)
    frequencies, amplitudes = random.uniform(0.01, 20.0, 17), random.standard_normal(17)
    phases = random.uniform(0.0, 2.0 * np.pi, 17)
    expected = np.zeros_like(time)
    for frequency, amplitude, phase in zip(frequencies, amplitudes, phases, strict=True):
        expected += amplitude * np.sin(2 * np.pi * frequency * time + phase)
    assert np.array_equal(sum_of_sines(time, frequencies, amplitudes, phases), expected)
