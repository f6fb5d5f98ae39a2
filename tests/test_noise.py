"""Noise estimates on signals whose noise is known."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.signals.motion import estimate_motion
from rigtwin.signals.noise import band, remove_mains, rms, white_noise

TIME = np.arange(20_000) * 1e-3


def noise(deviation: float, seed: int = 0) -> np.ndarray:
    return deviation * np.random.default_rng(seed).standard_normal(len(TIME))


@pytest.mark.parametrize("deviation", [0.1, 1.5, 10.0])
def test_white_noise_is_found_beneath_motion_hum_and_friction_jumps(deviation):
    jumps = 14.0 * np.sign(np.sin(2 * np.pi * 3.0 * TIME))
    signal = (
        230
        + 60 * np.sin(2 * np.pi * 1.0 * TIME)
        + 5 * np.sin(2 * np.pi * 50 * TIME)
        + jumps
        + noise(deviation)
    )
    hum_left = 5.0 * (2 * np.sin(np.pi * 0.05)) ** 3 / np.sqrt(2 * 20)
    assert white_noise(signal) == pytest.approx(np.hypot(deviation, hum_left), rel=0.05)


@pytest.mark.parametrize("frequency", [49.97, 50.0, 50.03])
def test_mains_is_taken_out_and_the_mean_stays(frequency):
    slow = 3.0 + np.sin(2 * np.pi * 0.7 * TIME)
    cleaned = remove_mains(slow + 5.0 * np.sin(2 * np.pi * frequency * TIME + 1.0), 1e-3, 50.0)
    assert rms(cleaned - slow) < 0.05
    assert np.mean(cleaned) == pytest.approx(np.mean(slow), abs=1e-2)


@pytest.mark.parametrize("rate", [10.0, 25.0, 50.0, 60.0, 100.0])
def test_a_line_that_was_sampled_too_slowly_to_show_is_left_alone(rate: float):
    # Of 50 samples a second the line would be a constant, and an offset would be taken for it.
    time = np.arange(0.0, 20.0, 1.0 / rate)
    signal = 3.0 + np.sin(2.0 * np.pi * 0.7 * time) + time**2
    assert remove_mains(signal, 1.0 / rate, 50.0) == pytest.approx(signal, abs=1e-12)


def test_band_holds_the_middle_of_the_power():
    low, high = band(np.sin(2 * np.pi * 5.0 * TIME), 1e-3)
    assert 4.5 <= low <= high <= 5.5
    assert band(np.zeros(1000), 1e-3) == (0.0, 0.0)


def test_motion_trusts_the_model_where_it_is_right_and_the_data_where_it_is_not():
    truth = 0.01 * np.sin(2 * np.pi * 0.8 * TIME)
    measured = truth + noise(6e-5)
    right = estimate_motion(measured, truth, 1e-3, 50.0)
    assert rms(right.position - truth) < 2e-6
    assert right.velocity_error == 0.0
    wrong = estimate_motion(measured, 0.9 * truth, 1e-3, 50.0)
    assert rms(wrong.position - truth) < 1.5e-5
    actual = np.std(np.gradient(wrong.position - truth, 1e-3)[1000:-1000])
    assert 0.5 < wrong.velocity_error / actual < 4.0
