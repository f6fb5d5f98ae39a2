"""End stops, against equations written by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import Guide
from rigtwin.components.end_stops import soften_stops
from rigtwin.components.guide_force import position_force
from tests.laws.joints import PERIOD, force_to_move, motion_under
from tests.laws.written import law_of

STOPPED = Guide(stop_stiffness=2000.0, stop_damping=30.0, stop_low=-0.02, stop_high=0.05)


@law_of("end_stops", Guide)
@pytest.mark.parametrize(
    ("position", "force"), [(0.053, 6.0), (0.05, 0.0), (0.01, 0.0), (-0.02, 0.0), (-0.024, -8.0)]
)
def test_a_stop_is_a_spring_beyond_its_end(position: float, force: float) -> None:
    assert position_force(STOPPED, position, 0.0) == pytest.approx(force, abs=1e-12)


@law_of("end_stops", Guide)
def test_a_stop_is_a_damper_where_it_is_touched() -> None:
    """F = k·(x − x_high) + c·v beyond the upper stop, and nothing between the stops."""
    time = PERIOD * np.arange(2000)
    position = 0.06 * np.sin(2.0 * np.pi * time)
    speed = np.gradient(position, PERIOD)
    high, low = np.maximum(position - 0.05, 0.0), np.minimum(position + 0.02, 0.0)
    touched = (high > 0.0) | (low < 0.0)
    expected = 2000.0 * (high + low) + 30.0 * speed * touched
    np.testing.assert_allclose(force_to_move(STOPPED, position), expected, atol=1e-9)


@law_of("end_stops", Guide)
@pytest.mark.parametrize("damping", [0.0, 8.0, 40.0])
def test_a_mass_rebounds_from_a_stop_as_a_damped_oscillator_does(damping: float) -> None:
    """Half a wave after contact v = −v₀·exp(−π·ζ/√(1 − ζ²)), with ζ = c/(2·√(k·m))."""
    mass, stiffness, speed, steps = 0.5, 3000.0, 0.4, 16
    guide = Guide(stop_stiffness=stiffness, stop_damping=damping, stop_low=-1.0, stop_high=0.02)
    share = damping / (2.0 * math.sqrt(stiffness * mass))
    half = math.pi / math.sqrt(stiffness / mass * (1.0 - share**2))
    ticks = round((0.02 / speed + half) / PERIOD) + 1
    moved = motion_under(guide, np.zeros(ticks), mass, start=(0.0, speed), steps=steps)
    rebound = -speed * math.exp(-math.pi * share / math.sqrt(1.0 - share**2))
    assert moved[1, -1] == pytest.approx(rebound, rel=0.03, abs=0.004)


def test_a_stop_is_no_stiffer_than_a_step_resolves() -> None:
    rigid = STOPPED._replace(stop_stiffness=1e12)
    assert soften_stops(rigid, 0.5, 1e-3).stop_stiffness == pytest.approx(0.5e6)
    assert soften_stops(STOPPED, 0.5, 1e-3) == STOPPED
    # A rigid stop ends the motion: nothing passes it by more than the way of a step or two.
    guide = soften_stops(rigid, 0.5, PERIOD / 4)
    moved = motion_under(guide, np.full(1000, 2.0), mass=0.5)
    assert 0.05 < np.max(moved[0]) < 0.05 + 2e-3
