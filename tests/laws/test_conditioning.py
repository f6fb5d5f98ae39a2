"""A command on its way: limits, delay, deadband, gain, saturation, rate limit, lag."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import (
    UNLIMITED,
    Computer,
    Cylinder,
    ForceActuator,
    Motor,
    Servo,
    VelocityServo,
)
from rigtwin.components.conditioning import actuator, condition, condition_all, hold, limit
from tests.laws.written import law_of

STEP = 1e-3
TIME = STEP * np.arange(400)
SWING = 1.2 * np.sin(2.0 * np.pi * 5.0 * TIME)
JUMP = np.where(TIME < 0.1, 0.2, 1.0)
RAMP = 0.3 + 2.0 * np.maximum(TIME - 0.05, 0.0)
ACTUATORS = [Motor(), Cylinder(), ForceActuator(), Servo(), VelocityServo()]
THRESHOLDS = [Motor(), ForceActuator(), VelocityServo()]
"""Actuators whose deadband lies about zero."""


def passed(component, commands: np.ndarray, late: float = 0.0) -> np.ndarray:
    """Return what becomes of commands, shape (steps,), after the first one was held for long."""
    conditioning = actuator(component, Computer(delay=late), STEP)
    state = hold(conditioning, float(commands[0]))
    return np.array([condition(conditioning, state, float(command)) for command in commands])


@pytest.mark.parametrize("component", ACTUATORS)
def test_a_nominal_actuator_passes_commands_as_they_are(component):
    assert actuator(component, Computer(), STEP).neutral is True
    assert np.array_equal(passed(component, SWING), SWING)


@pytest.mark.parametrize(
    "component",
    [
        *(of._replace(**{name: value}) for of in ACTUATORS for name, value in
          (("delay", 1e-3), ("gain", 1.1), ("lag", 1e-3))),
        *(of._replace(**{name: 0.1}) for of in (Cylinder(), *THRESHOLDS)
          for name in ("deadband", "saturation")),
        *(of._replace(rate_limit=1.0) for of in (Servo(), *THRESHOLDS)),
        ForceActuator(gain_asymmetry=0.1),
        ForceActuator(deadband_asymmetry=0.1),
    ],
)  # fmt: skip
def test_an_actuator_with_any_effect_is_not_neutral(component):
    assert actuator(component, Computer(), STEP).neutral is False
    assert actuator(type(component)(), Computer(delay=1e-3), STEP).neutral is False


def test_a_command_that_is_held_for_long_has_settled():
    """Gain 1.1, deadband 0.2 and lag: the held output is the steady one."""
    motor = passed(Motor(gain=1.1, deadband=0.2, lag=0.05, delay=0.01), np.full(5, 0.9))
    assert motor == pytest.approx(np.full(5, 1.1 * 0.7))
    plate = passed(Cylinder(gain=1.1, deadband=0.2, lag=0.05, delay=0.01), np.full(5, 0.9))
    assert plate == pytest.approx(np.full(5, 1.1 * 0.9))


@law_of("gain", Motor, Cylinder, ForceActuator, Servo, VelocityServo)
@pytest.mark.parametrize("component", ACTUATORS)
@pytest.mark.parametrize("gain", [0.8, 1.07])
def test_a_gain_multiplies_the_command(component, gain):
    assert passed(component._replace(gain=gain), SWING) == pytest.approx(gain * SWING)


@law_of("gain_asymmetry", ForceActuator)
def test_a_gain_differs_by_half_its_asymmetry_each_way():
    uneven = ForceActuator(gain=1.2, gain_asymmetry=0.4)
    for size in (1.0, 1e-3):
        expected = 1.2 * (1.0 + 0.2 * np.sign(SWING)) * size * SWING
        assert passed(uneven, size * SWING) == pytest.approx(expected, abs=1e-12)


@law_of("curvature", ForceActuator)
@pytest.mark.parametrize("share", [0.4, 1.0, -0.3])
def test_a_share_of_a_force_grows_with_the_square_of_its_command(share):
    curved = ForceActuator(gain=1.2, curvature=share, full_command=2.5)
    expected = 1.2 * ((1.0 - share) * SWING + share * SWING * np.abs(SWING) / 2.5)
    assert passed(curved, SWING) == pytest.approx(expected, abs=1e-12)


@law_of("lag", Motor, Cylinder, ForceActuator, Servo, VelocityServo)
@pytest.mark.parametrize("component", ACTUATORS)
@pytest.mark.parametrize("lag", [0.004, 0.03])
def test_a_lag_answers_a_jump_with_an_exponential(component, lag):
    """The mean of y = 1 − 0.8 exp(−(t − t₀)/T) over the coming step, in which the command acts."""
    since = np.maximum(TIME - 0.1, 0.0)
    falls = np.exp(-since / lag) - np.exp(-(since + STEP) / lag)
    expected = np.where(TIME < 0.1 - 0.5 * STEP, 0.2, 1.0 - 0.8 * lag / STEP * falls)
    assert passed(component._replace(lag=lag), JUMP) == pytest.approx(expected, abs=1e-9)


@law_of("delay", Motor, Cylinder, ForceActuator, Servo, VelocityServo, Computer)
@pytest.mark.parametrize("component", ACTUATORS)
@pytest.mark.parametrize(("own", "late"), [(0.0035, 0.0), (0.0, 0.0102), (0.002, 0.003)])
def test_a_delay_of_actuator_and_computer_shifts_the_command(component, own, late):
    found = passed(component._replace(delay=own), RAMP, late)
    expected = 0.3 + 2.0 * np.maximum(TIME - own - late - 0.05, 0.0)
    assert found == pytest.approx(expected, abs=1.1e-3)
    assert found[80:] == pytest.approx(expected[80:])


@law_of("saturation", Motor, Cylinder, ForceActuator, VelocityServo)
@pytest.mark.parametrize("component", [Cylinder(), *THRESHOLDS])
def test_a_saturation_limits_both_signs(component):
    found = passed(component._replace(saturation=0.7), SWING)
    assert found == pytest.approx(np.clip(SWING, -0.7, 0.7))


@law_of("rate_limit", Motor, ForceActuator, Servo, VelocityServo)
@pytest.mark.parametrize("component", [*THRESHOLDS, Servo()])
def test_a_rate_limit_lets_the_output_climb_at_that_rate(component):
    found = passed(component._replace(rate_limit=4.0), JUMP)
    since = np.maximum(TIME + STEP - 0.1, 0.0)
    assert found == pytest.approx(np.minimum(0.2 + 4.0 * since, 1.0))
    assert passed(component._replace(rate_limit=4.0), 1.2 - JUMP) == pytest.approx(1.2 - found)


@law_of("deadband", Motor, ForceActuator, VelocityServo)
@pytest.mark.parametrize("component", THRESHOLDS)
def test_a_deadband_about_zero_takes_its_width_off_the_command(component):
    found = passed(component._replace(deadband=0.3), SWING)
    expected = np.sign(SWING) * np.maximum(np.abs(SWING) - 0.3, 0.0)
    assert found == pytest.approx(expected)


@law_of("deadband", Cylinder)
def test_a_cylinders_deadband_is_a_play_about_its_last_position():
    """A valve's overlap: after each reversal the command goes twice the band without effect."""
    found = passed(Cylinder(deadband=0.3), SWING)
    expected, last = np.empty(len(SWING)), 0.0
    for number, command in enumerate(SWING):
        if command - last > 0.3:
            last = command - 0.3
        if last - command > 0.3:
            last = command + 0.3
        expected[number] = last
    assert found == pytest.approx(expected)
    assert np.ptp(found) == pytest.approx(2.4 - 0.6, abs=1e-3)


@law_of("deadband_asymmetry", ForceActuator)
@pytest.mark.parametrize(
    ("band", "more", "upper", "lower"),
    [(0.3, 0.2, 0.4, 0.2), (0.3, -0.2, 0.2, 0.4), (0.0, -0.4, 0.0, 0.2), (0.1, 0.4, 0.3, 0.0)],
)
def test_a_deadband_reaches_half_its_asymmetry_further_one_way(band, more, upper, lower):
    found = passed(ForceActuator(deadband=band, deadband_asymmetry=more), SWING)
    expected = np.maximum(SWING - upper, 0.0) + np.minimum(SWING + lower, 0.0)
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("kind", [ForceActuator, Servo, VelocityServo])
def test_a_command_is_limited_before_anything_else(kind):
    limited = kind(command_low=-0.5, command_high=0.9)
    assert passed(limited, SWING) == pytest.approx(np.clip(SWING, -0.5, 0.9))
    doubled = passed(limited._replace(gain=2.0), SWING)
    assert doubled == pytest.approx(2.0 * np.clip(SWING, -0.5, 0.9))
    assert passed(limited._replace(gain=2.0), SWING + 5.0)[0] == pytest.approx(1.8)


def test_a_servos_command_has_no_deadband_and_no_saturation():
    assert np.array_equal(passed(Servo(deadband=0.3), SWING), SWING)
    assert actuator(Servo(deadband=0.3), Computer(), STEP).saturation == UNLIMITED


def test_deadband_gain_and_saturation_act_in_this_order():
    """Command 1, deadband 0.2, gain 2, saturation 1.5: 1.5 of 1.6; with 1.9: 1.6."""
    for saturation, expected in ((1.5, 1.5), (1.9, 1.6)):
        motor = Motor(deadband=0.2, gain=2.0, saturation=saturation)
        conditioning = actuator(motor, Computer(), STEP)
        assert limit(conditioning, hold(conditioning, 0.0), 1.0) == pytest.approx(expected)
        assert limit(conditioning, hold(conditioning, 0.0), -1.0) == pytest.approx(-expected)


def test_the_rate_limit_acts_before_the_lag():
    """A ramp of rate r through a lag T stays behind by r T (1 − exp(−t/T))."""
    found = passed(Motor(rate_limit=2.0, lag=0.02), np.where(TIME < 0.1, 0.0, 50.0))
    since = np.maximum(TIME + STEP - 0.1, 0.0)
    expected = 2.0 * (since - 0.02 * (1.0 - np.exp(-since / 0.02)))
    assert found == pytest.approx(expected, abs=1.1e-3)


def test_no_limit_of_the_rate_is_infinitely_fast():
    assert actuator(Motor(), Computer(), STEP).rate == UNLIMITED
    assert actuator(Cylinder(), Computer(), STEP).rate == UNLIMITED
    assert actuator(Motor(rate_limit=5.0), Computer(), STEP).rate == pytest.approx(5e-3)


def test_conditioning_all_commands_at_once_holds_them_over_their_steps():
    component = Motor(lag=0.02, gain=1.1)
    conditioning = actuator(component, Computer(), STEP)
    held, out = np.array([0.0, 1.0, -0.5]), np.empty(12)
    condition_all(conditioning, hold(conditioning, 0.0), held, 4, out)
    assert out == pytest.approx(passed(component, np.repeat(held, 4)))
