"""What pushes a joint: a force actuator in proportion to its command, or a servo by its error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import ForceActuator, Guide, Servo, VelocityServo
from rigtwin.components.servo import pull, push, push_all, push_law
from tests.laws.joints import PERIOD, motion_under
from tests.laws.written import law_of

STATES = [(0.3, 0.1, 0.0), (0.1, 0.3, 0.2), (-0.2, 0.4, -0.5), (0.105, 0.1, 0.03), (2.0, -2.0, 1.0)]
"""Command, position m and speed m/s."""


@law_of("position_gain", Servo)
@law_of("damping_gain", Servo)
@law_of("gains", Servo)
@law_of("force_limit", Servo)
@law_of("deadband", Servo)
@pytest.mark.parametrize(
    "servo",
    [
        Servo(),
        Servo(position_gain=80.0),
        Servo(position_gain=0.005, damping_gain=0.3),
        Servo(position_gain=80.0, damping_gain=3.0),
        Servo(position_gain=80.0, damping_gain=3.0, force_limit=12.0),
        Servo(position_gain=80.0, deadband=0.02, damping_gain=3.0),
        Servo(position_gain=80.0, deadband=0.02, damping_gain=3.0, gains=1.7),
    ],
)
@pytest.mark.parametrize("state", STATES)
def test_a_servo_pushes_by_its_error_less_its_damping_within_its_limit(servo, state):
    """F = g (k (e − band sgn e) − d v) within ± limit, and no k e within the band."""
    command, position, speed = state
    error = command - position
    beyond = math.copysign(max(abs(error) - servo.deadband, 0.0), error)
    force = servo.gains * (servo.position_gain * beyond - servo.damping_gain * speed)
    expected = min(max(force, -servo.force_limit), servo.force_limit)
    law = push_law(servo)
    assert push(law, command, position, speed) == pytest.approx(expected)
    pulled = servo.gains * servo.position_gain * beyond
    assert pull(law, command, position) == pytest.approx(pulled)


@law_of("gains", VelocityServo)
@law_of("force_limit", VelocityServo)
@pytest.mark.parametrize(
    "servo",
    [
        VelocityServo(),
        VelocityServo(velocity_gain=80.0, damping_gain=0.0),
        VelocityServo(velocity_gain=-80.0, damping_gain=3.0),
        VelocityServo(velocity_gain=80.0, damping_gain=30.0, force_limit=12.0, gains=1.7),
    ],
)
@pytest.mark.parametrize("state", STATES)
def test_a_velocity_servo_pushes_by_its_command_less_its_damping_within_its_limit(servo, state):
    """F = g (k u − d v) within ± limit, wherever the joint is."""
    command, position, speed = state
    force = servo.gains * (servo.velocity_gain * command - servo.damping_gain * speed)
    expected = min(max(force, -servo.force_limit), servo.force_limit)
    assert push(push_law(servo), command, position, speed) == pytest.approx(expected)


@law_of("gains", VelocityServo)
def test_a_mass_under_a_velocity_servo_gains_speed_as_a_first_order_lag():
    """m v' = g (k u − d v): v = k u / d (1 − exp(−g d t / m)), and x is its integral."""
    mass, gain, damper, gains = 2.0, 30.0, 12.0, 1.5
    servo = VelocityServo(velocity_gain=gain, damping_gain=damper, gains=gains)
    position = motion_under(Guide(), np.full(800, 0.05), mass, servo, steps=8)[0]
    time, decay = PERIOD * np.arange(800), gains * damper / mass
    expected = 0.05 * gain / damper * (time - (1.0 - np.exp(-decay * time)) / decay)
    np.testing.assert_allclose(position, expected, atol=1e-3 * expected[-1])


@pytest.mark.parametrize("state", STATES)
def test_a_force_actuator_pushes_with_its_constant_wherever_the_joint_is(state):
    command, position, speed = state
    assert push(push_law(ForceActuator()), command, position, speed) == pytest.approx(command)
    geared = push_law(ForceActuator(constant=-30.0, force_limit=20.0))
    assert push(geared, command, position, speed) == pytest.approx(
        min(max(-30.0 * command, -20.0), 20.0)
    )


def test_pushes_of_all_ticks_are_those_of_every_tick():
    law = push_law(Servo(position_gain=80.0, damping_gain=3.0, force_limit=12.0))
    commands, positions, speeds = np.array(STATES).T.copy()
    expected = np.clip(80.0 * (commands - positions) - 3.0 * speeds, -12.0, 12.0)
    assert push_all(law, commands, positions, speeds) == pytest.approx(expected)


def test_a_limit_that_is_left_out_is_the_widest():
    assert push_law(Servo()).limit == 1e9
    assert push_law(ForceActuator(constant=3.0)) == (3.0, 0.0, 0.0, 0.0, 1e9, 0.0)
    assert push_law(ForceActuator(force_limit=2e9)).limit == 1e9


@law_of("position_gain", Servo)
@law_of("damping_gain", Servo)
def test_a_mass_under_a_servo_swings_as_a_damped_oscillator():
    """m x'' = k (c − x) − d x': x = c (1 − exp(−ζωt)(cos ω_d t + ζω/ω_d sin ω_d t))."""
    mass, stiffness, damper = 2.0, 500.0, 12.0
    servo = Servo(position_gain=stiffness, damping_gain=damper)
    position = motion_under(Guide(), np.full(800, 0.05), mass, servo, steps=8)[0]
    time = PERIOD * np.arange(800)
    decay = damper / (2.0 * mass)
    damped = math.sqrt(stiffness / mass - decay**2)
    swing = np.cos(damped * time) + decay / damped * np.sin(damped * time)
    expected = 0.05 * (1.0 - np.exp(-decay * time) * swing)
    np.testing.assert_allclose(position, expected, atol=1e-3 * 0.05)


@law_of("force_limit", Servo)
def test_a_servo_at_its_limit_accelerates_a_mass_evenly():
    servo = Servo(position_gain=1e4, damping_gain=5.0, force_limit=6.0)
    position = motion_under(Guide(), np.full(300, 5.0), 2.0, servo)[0]
    time = PERIOD * np.arange(300)
    np.testing.assert_allclose(position, 0.5 * 3.0 * time**2, atol=1.1e-3 * position[-1])
