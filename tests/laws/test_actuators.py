"""A position actuator: limits, delay, play, gain and offset, saturation, rate limit, lags."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import PositionActuator
from rigtwin.models.following import follow_command
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = PERIOD * np.arange(1000)
RAMP = 0.1 + 0.2 * np.maximum(TIME - 0.1, 0.0)
LATE = 0.5 * PERIOD
"""A held command is late by half a tick on average."""
SWING = 0.05 * np.sin(2.0 * np.pi * 2.0 * TIME)
AGO = 0.05 * np.sin(2.0 * np.pi * 2.0 * np.maximum(TIME - LATE, 0.0))
JUMP = np.where(TIME < 0.1, 0.0, 0.02)


def followed(command: np.ndarray, late: float = 0.0, **values: float) -> np.ndarray:
    """Return the positions in m, shape (ticks,), under a command."""
    return follow_command(PositionActuator(**values), command, late, PERIOD, 4)


def test_a_nominal_actuator_follows_half_a_tick_late():
    np.testing.assert_allclose(followed(SWING), AGO, atol=1e-6)


@law_of("gain", PositionActuator)
@law_of("offset", PositionActuator)
@law_of("saturation", PositionActuator)
@pytest.mark.parametrize(
    ("gain", "offset", "limit"), [(0.9, 0.0, 1e9), (1.0, 0.01, 1e9), (1.2, -0.01, 0.04)]
)
def test_the_position_is_scaled_then_displaced_then_limited(gain, offset, limit):
    found = followed(SWING, gain=gain, offset=offset, saturation=limit)
    np.testing.assert_allclose(found, np.clip(gain * AGO + offset, -limit, limit), atol=1e-6)


@law_of("delay", PositionActuator)
@pytest.mark.parametrize(("own", "late"), [(0.015, 0.0), (0.0, 0.0123), (0.004, 0.003)])
def test_a_delay_shifts_the_position(own, late):
    expected = 0.1 + 0.2 * np.maximum(TIME - LATE - own - late - 0.1, 0.0)
    found = followed(RAMP, late, delay=own)
    np.testing.assert_allclose(found[150:], expected[150:], atol=1e-12)
    np.testing.assert_allclose(found[:100], 0.1, atol=1e-12)


@law_of("deadband", PositionActuator)
def test_a_play_takes_its_width_off_each_reversal():
    found = followed(SWING, deadband=0.01)
    expected, place = np.empty(len(AGO)), 0.0
    for number, command in enumerate(AGO):
        place = min(max(place, command - 0.01), command + 0.01)
        expected[number] = place
    np.testing.assert_allclose(found, expected, atol=1e-6)


@law_of("rate_limit", PositionActuator)
def test_a_rate_limit_lets_the_position_climb_at_that_rate():
    found = followed(JUMP, rate_limit=0.05)
    expected = np.clip(0.05 * (TIME - 0.1), 0.0, 0.02)
    np.testing.assert_allclose(found, expected, atol=0.05 * PERIOD)
    assert np.max(np.diff(found)) == pytest.approx(0.05 * PERIOD)


@law_of("lag", PositionActuator)
@pytest.mark.parametrize("lag", [0.01, 0.05])
def test_a_lag_answers_a_jump_with_an_exponential(lag):
    expected = 0.02 * (1.0 - np.exp(-np.maximum(TIME - 0.1, 0.0) / lag))
    found = followed(JUMP, lag=lag)
    # The held command passes from one value to the next over a tick about the jump.
    away = np.abs(TIME - 0.1) > 1.5 * PERIOD
    np.testing.assert_allclose(found[away], expected[away], atol=0.02 * 0.002)


@law_of("two_lags", PositionActuator)
@pytest.mark.parametrize(("long", "short"), [(0.05, 0.02), (0.08, 0.01)])
def test_two_lags_answer_a_jump_one_behind_the_other(long, short):
    """y = 1 − (T₁ exp(−t/T₁) − T₂ exp(−t/T₂))/(T₁ − T₂)."""
    since = np.maximum(TIME - 0.1, 0.0)
    fading = (long * np.exp(-since / long) - short * np.exp(-since / short)) / (long - short)
    found = followed(JUMP, lag=long, second_lag=short)
    np.testing.assert_allclose(found, 0.02 * (1.0 - fading), atol=0.02 * 0.003)


@law_of("resonance", PositionActuator)
@pytest.mark.parametrize(("frequency", "ratio"), [(3.0, 0.3), (5.0, 0.7), (4.0, 1.0 - 1e-9)])
def test_a_resonance_answers_a_jump_as_a_damped_oscillator(frequency, ratio):
    """y = 1 − exp(−ζωt)(cos ω_d t + ζω/ω_d sin ω_d t)."""
    since = np.maximum(TIME - 0.1, 0.0)
    w = 2.0 * math.pi * frequency
    damped = w * math.sqrt(1.0 - ratio**2)
    # sinc(x) = sin(πx)/(πx) stays finite at critical damping.
    swing = np.cos(damped * since) + ratio * w * since * np.sinc(damped * since / math.pi)
    expected = 0.02 * (1.0 - np.exp(-ratio * w * since) * swing)
    found = followed(JUMP, natural_frequency=frequency, damping_ratio=ratio)
    np.testing.assert_allclose(found, expected, atol=0.02 * 0.002)


def test_the_nominal_damping_ratio_is_0_7():
    nominal = followed(JUMP, natural_frequency=4.0)
    assert np.array_equal(nominal, followed(JUMP, natural_frequency=4.0, damping_ratio=0.7))


def test_a_command_is_limited_before_anything_else():
    found = followed(SWING, command_low=-0.02, command_high=0.03, gain=2.0)
    np.testing.assert_allclose(found, 2.0 * np.clip(AGO, -0.02, 0.03), atol=2e-4)
    assert np.max(found) == pytest.approx(0.06)
    assert np.min(found) == pytest.approx(-0.04)
