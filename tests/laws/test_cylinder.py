"""A hydraulic cylinder: H(s) sampled exactly, then a limit of the speed and a play."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import Cylinder
from rigtwin.components.cylinder import (
    advance_cylinder,
    closed_loop,
    discretise,
    follow,
    next_piston,
    next_position,
    rest_state,
    told_settings,
)
from tests.laws.written import law_of

STEP = 1e-3
TIME = STEP * np.arange(1, 601)
QUICK = Cylinder(speed_limit=10.0)
OTHER = QUICK._replace(b2=900.0, b1=5e4, b0=5e5, a3=140.0, a2=6000.0, a1=8e4, a0=5.5e5)


def moved(cylinder: Cylinder, commands: np.ndarray, start: float = 0.0) -> np.ndarray:
    """Return the plate's positions in m, shape (steps,), at the end of every step."""
    model, state = discretise(cylinder, STEP), rest_state(cylinder, start)
    positions = []
    for command in commands:
        foreseen = next_position(model, state, float(command))
        advance_cylinder(model, state, float(command))
        assert state.position[0] == foreseen
        positions.append(foreseen)
    return np.array(positions)


def step_response(cylinder: Cylinder, time: np.ndarray) -> np.ndarray:
    """Return the response of H(s)/H(0) to a unit step, by its poles and residues.

    y(t) = 1 + Σ H(p)'s residue · exp(p t)/p over the four poles p.
    """
    below = [1.0, cylinder.a3, cylinder.a2, cylinder.a1, cylinder.a0]
    above = np.array([cylinder.b2, cylinder.b1, cylinder.b0]) * cylinder.a0 / cylinder.b0
    response = np.ones(len(time), complex)
    for pole in np.roots(below):
        residue = np.polyval(above, pole) / np.polyval(np.polyder(below), pole)
        response += residue / pole * np.exp(pole * time)
    return response.real


@pytest.mark.parametrize("cylinder", [QUICK, OTHER])
def test_a_step_of_the_command_has_the_response_of_the_transfer_function(cylinder):
    found = moved(cylinder, np.full(600, 0.01))
    np.testing.assert_allclose(found, 0.01 * step_response(cylinder, TIME), atol=1e-10)


@pytest.mark.parametrize("cylinder", [Cylinder(), OTHER])
def test_a_cylinder_at_rest_stays_where_its_command_holds_it(cylinder):
    assert moved(cylinder, np.full(50, 0.03), 0.03) == pytest.approx(np.full(50, 0.03), abs=1e-12)


@law_of("rate_limit", Cylinder)
@pytest.mark.parametrize("limit", [0.3, 0.05])
def test_the_piston_moves_no_faster_than_its_limit(limit):
    found = moved(Cylinder(speed_limit=limit), np.full(600, 0.5))
    steps = np.diff(np.append(0.0, found))
    assert np.max(steps) == pytest.approx(limit * STEP, abs=1e-15)
    back = moved(Cylinder(speed_limit=limit), np.full(600, -0.5))
    assert back == pytest.approx(-found)
    # Once H(s) is ahead by more than a step, the piston moves at the limit until it catches up.
    free = 0.5 * step_response(Cylinder(), TIME)
    ahead = free > found + 1e-9
    assert np.allclose(steps[ahead], limit * STEP)
    assert np.count_nonzero(ahead) > 100


def test_the_nominal_cylinder_moves_at_300_mm_a_second():
    model = discretise(Cylinder(), STEP)
    assert model.step == pytest.approx(0.3e-3)
    assert model.transition.shape == (4, 4)


@law_of("backlash", Cylinder)
def test_the_plate_follows_the_piston_but_for_half_the_play():
    loose = QUICK._replace(backlash=0.004)
    commands = 0.01 * np.sin(2.0 * np.pi * 2.0 * TIME)
    piston = moved(QUICK, commands)
    expected, plate = np.empty(len(piston)), 0.0
    for number, place in enumerate(piston):
        if place - plate > 0.002:
            plate = place - 0.002
        if plate - place > 0.002:
            plate = place + 0.002
        expected[number] = plate
    assert moved(loose, commands) == pytest.approx(expected)
    model, state = discretise(loose, STEP), rest_state(loose, 0.01)
    assert follow(model, state, 0.013) == pytest.approx(0.011)
    assert follow(model, state, 0.005) == pytest.approx(0.007)
    assert follow(model, state, 0.0085) == 0.01


def test_looking_ahead_changes_nothing():
    model, state = discretise(QUICK, STEP), rest_state(QUICK, 0.01)
    before = state.filter.copy(), state.position.copy()
    next_piston(model, state, 0.5)
    next_position(model, state, 0.5)
    assert np.array_equal(state.filter, before[0])
    assert np.array_equal(state.position, before[1])


def test_a_controller_is_told_the_transfer_function_and_the_whole_delay():
    cylinder = OTHER._replace(gain=1.1, lag=0.004, delay=0.006)
    parts = closed_loop(cylinder)
    assert (parts.b0, parts.a3, parts.gain, parts.lag, parts.delay) == (
        5e5,
        140.0,
        1.1,
        0.004,
        0.006,
    )
    settings = told_settings(cylinder, before=0.003)
    assert settings["plate_delay"] == pytest.approx(0.009)
    assert settings["plate_gain"] == 1.1
    assert told_settings(cylinder)["plate_delay"] == 0.006
    assert told_settings(cylinder, before=1.0)["plate_delay"] == 0.05
