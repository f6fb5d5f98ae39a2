"""The friction compensators: their rules one by one, and what they gain on the twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controllers import Compensator, Settings
from controllers.friction import (
    ERRORS,
    HISTORY,
    NO_ERRORS,
    NO_VELOCITIES,
    REST,
    advance_motor_model,
    error_has_risen,
    expected_direction,
    observe_friction,
    step_compensator,
)
from rigtwin.signals.noise import rms

PERIOD = 1e-3
THESIS = Settings(compensator=Compensator.ONE_STEP)


def slowing(rate: float, now: float) -> tuple[float, ...]:
    """Velocities that change by `rate` m/s², the newest first."""
    return tuple(now - rate * PERIOD * number for number in range(HISTORY))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_window_opens_before_a_crossing(side):
    # 10 mm/s slowing by 0.5 m/s² crosses zero in 20 ms; by 0.2 m/s² in 50 ms.
    assert expected_direction(THESIS, slowing(-0.5 * side, 0.01 * side), 0.0, PERIOD) == -side
    assert expected_direction(THESIS, slowing(-0.2 * side, 0.01 * side), 0.0, PERIOD) == 0.0
    assert expected_direction(THESIS, slowing(0.5 * side, 0.01 * side), 0.0, PERIOD) == 0.0
    # The filtered acceleration opens it where the carried parabola does not.
    assert expected_direction(THESIS, slowing(0.0, 0.01 * side), -0.5 * side, PERIOD) == -side


def test_a_spike_must_have_risen_for_five_samples():
    rising = tuple(5.0 - 0.5 * number for number in range(ERRORS))
    assert error_has_risen(THESIS, rising, 1.0, PERIOD)
    assert not error_has_risen(THESIS, rising, -1.0, PERIOD)
    assert error_has_risen(THESIS, tuple(-e for e in rising), -1.0, PERIOD)
    dented = (5.0, 4.5, 4.45, 3.5, 3.0, 2.5)
    assert not error_has_risen(THESIS, dented, 1.0, PERIOD)
    flat_at_first = (5.0, 4.5, 4.0, 3.5, 3.0, 3.0)
    assert error_has_risen(THESIS, flat_at_first, 1.0, PERIOD)


def driven(settings: Settings, ticks: int, friction: float = 14.0):
    """The compensator beside a motor that reverses at 0.1 s: travel slows and turns, the error
    jumps and decays."""
    state, velocities, errors, added = REST, NO_VELOCITIES, NO_ERRORS, []
    for tick in range(ticks):
        t = tick * PERIOD - 0.1
        travel = 0.25 * t**2
        error = 0.0 if t < 0 else 2 * friction * (1 - math.exp(-t / 0.004)) * math.exp(-t / 0.05)
        state, velocities, errors = step_compensator(
            settings, state, velocities, errors, travel, error, PERIOD
        )
        added.append(state.added)
    return np.array(added)


def test_one_step_comes_once_within_milliseconds():
    added = driven(THESIS, 130)
    assert set(np.unique(added)) == {0.0, THESIS.friction_step / 2}
    assert 0.1 < np.argmax(added > 0) * PERIOD < 0.108


def test_two_steps_sum_to_one():
    added = driven(THESIS._replace(compensator=Compensator.TWO_STEP), 400)
    assert added.max() == pytest.approx(THESIS.friction_step)
    assert added[-1] == pytest.approx(THESIS.friction_step / 2)


def test_the_buffer_keeps_steps_apart():
    settings = THESIS._replace(compensator=Compensator.FORCE_THRESHOLD)
    state, velocities, errors, added = REST, NO_VELOCITIES, NO_ERRORS, []
    for tick in range(400):
        # An error that swings every 15 ms: the direction of friction seems to change far more often
        # than steps may come.
        error = 10.0 if (tick // 15) % 2 else -10.0
        state, velocities, errors = step_compensator(
            settings, state, velocities, errors, 0.0, error, PERIOD
        )
        added.append(state.added)
    times = np.flatnonzero(np.diff(added)) * PERIOD
    assert len(times) > 4
    assert np.diff(times).min() >= 0.04 - 1e-9


@pytest.mark.parametrize("mains", [0.0, 5.0])
def test_the_observer_finds_the_friction_and_its_reversal(mains):
    settings = Settings(compensator=Compensator.OBSERVER)
    random = np.random.default_rng(1)
    state, motor, found = REST, 200.0, []
    for tick in range(4000):
        friction = 14.0 if (tick // 700) % 2 else -14.0
        hum = mains * math.sin(2 * math.pi * 50.0 * tick * PERIOD)
        state = observe_friction(
            settings, state, motor - friction + hum + 1.5 * random.standard_normal(), PERIOD
        )
        found.append((state.friction, friction))
        told = 200.0 + state.added
        state = advance_motor_model(state, told, PERIOD)
        stays = math.exp(-PERIOD / 1.26e-3)
        motor = stays * motor + (1 - stays) * told
    estimate, truth = np.array(found).T
    assert rms((estimate - truth)[2000:]) < 1.2
    # After each reversal the estimate is there within two samples.
    for turn in (2100, 2800, 3500):
        assert np.abs(estimate - truth)[turn + 1 : turn + 6].max() < 6.0
