"""Forces of a guide that follow a recorded channel."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components.schedule import Schedule, follow, scheduled_force
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = np.arange(3000) * PERIOD
POSITION = 0.02 * np.sin(2 * np.pi * 1.3 * TIME) + 0.008 * np.sin(2 * np.pi * 3.1 * TIME)
SPEED = np.gradient(POSITION, PERIOD)
MOTION = np.stack([POSITION, SPEED, np.gradient(SPEED, PERIOD)])
VOLTAGE = 1.0 + np.sin(2 * np.pi * 0.7 * TIME)


@law_of("coulomb", Schedule)
@law_of("viscous", Schedule)
@law_of("offset", Schedule)
def test_the_force_is_that_of_a_guide_times_the_channel():
    """F = (20 s + 3 v − 2) u, with the direction s of the motion."""
    schedule = Schedule(coulomb=20.0, viscous=3.0, offset=-2.0)
    force = scheduled_force(schedule, VOLTAGE, MOTION, 1e9)
    moving = np.abs(SPEED) > 0.01
    moving[0] = False
    expected = VOLTAGE * (20.0 * np.sign(SPEED) + 3.0 * SPEED - 2.0)
    np.testing.assert_allclose(force[moving], expected[moving], atol=1e-6)


@law_of("lag", Schedule)
def test_the_channel_acts_behind_a_first_order_lag():
    """After a step of 2 V, u = 2 (1 − exp(−t/T))."""
    step = np.where(TIME > 1.0 - PERIOD / 2, 2.0, 0.0)
    late = follow(Schedule(lag=0.05), step, PERIOD)
    expected = 2.0 * (1.0 - np.exp(-np.maximum(TIME - 1.0, 0.0) / 0.05))
    np.testing.assert_allclose(late, expected, atol=0.05)


@law_of("rounding", Schedule)
def test_rounded_friction_is_a_hyperbolic_tangent_of_the_speed():
    """F = 20 u tanh(v / 0.03)."""
    force = scheduled_force(Schedule(coulomb=20.0, rounding=0.03), VOLTAGE, MOTION, 1e9)
    np.testing.assert_allclose(force, 20.0 * VOLTAGE * np.tanh(SPEED / 0.03), atol=1e-9)


@law_of("growth", Schedule)
@pytest.mark.parametrize("growth", [-0.045, 1e-9, 0.02])
def test_a_force_that_grows_with_its_channel_is_exponential_about_the_middle(growth: float):
    """u = 40 + (exp(g (c − 40)) − 1) / g, whose slope about the middle is 1."""
    warm = np.linspace(20.0, 60.0, len(TIME))
    grown = follow(Schedule(growth=growth, growth_about=40.0), warm, PERIOD)
    np.testing.assert_allclose(grown, 40.0 + (np.exp(growth * (warm - 40.0)) - 1.0) / growth, 1e-4)
