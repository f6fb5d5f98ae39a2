"""Play between a motor and its joint, beside the same play as a limited joint of MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rigtwin.components import ForceActuator, Guide, Servo
from rigtwin.numerics.arrays import Array
from tests.laws.joints import INTERPRETED, PERIOD, motion_under
from tests.laws.written import law_of

INERTIA, GAIN, DAMPING, PLAY = 0.03, 25.0, 1.0, 0.08
TWO_MASSES = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 0" timestep="5e-5" integrator="implicitfast"/>
  <worldbody>
    <body name="rotor">
      <joint name="rotor" axis="0 0 1" frictionloss="{friction}" solreffriction="2e-4 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 {rotor}"/>
      <body name="link">
        <joint name="play" axis="0 0 1" limited="true" range="{low} {high}"
               solreflimit="2e-4 1" solimplimit="0.999 0.9999 1e-4"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 {link}"/>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="rotor" kp="{gain}" kv="{damping}"/></actuator>
</mujoco>
"""


def commanded(ticks: int) -> Array:
    time = np.arange(ticks) * PERIOD
    return 0.4 * np.sin(9.0 * time) + 0.2 * np.sin(23.0 * time)


def angles_in_mujoco(command: Array, share: float, friction: float) -> Array:
    """Return the angle of the link behind the play, rad, shape (ticks,)."""
    text = TWO_MASSES.format(
        rotor=share * INERTIA,
        link=(1.0 - share) * INERTIA,
        low=-0.5 * PLAY,
        high=0.5 * PLAY,
        gain=GAIN,
        damping=DAMPING,
        friction=friction,
    )
    model = mujoco.MjModel.from_xml_string(text)
    data, angles = mujoco.MjData(model), np.empty(len(command))
    for tick, value in enumerate(command):
        angles[tick], data.ctrl[0] = data.qpos.sum(), value
        mujoco.mj_step(model, data, round(PERIOD / model.opt.timestep))
    return angles


@law_of("backlash", Servo)
@pytest.mark.skipif(INTERPRETED, reason="calls MuJoCo")
@pytest.mark.parametrize("share", [0.2, 0.6])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_link_moves_as_that_of_two_masses_in_mujoco(share: float, friction: float) -> None:
    command = commanded(3000)
    servo = Servo(
        position_gain=GAIN,
        damping_gain=DAMPING,
        backlash=PLAY,
        rotor_share=share,
        rotor_friction=friction,
    )
    predicted = motion_under(Guide(), command, INERTIA, servo, steps=8)[0]
    true = angles_in_mujoco(command, share, friction)
    without = motion_under(Guide(), command, INERTIA, servo._replace(backlash=0.0), steps=8)[0]
    assert np.std(predicted - true) < 0.05 * np.std(without - true)


def test_without_play_the_servo_moves_the_joint_as_one_mass() -> None:
    command = commanded(500)
    rigid = Servo(position_gain=GAIN, damping_gain=DAMPING)
    tiny = rigid._replace(backlash=1e-9, rotor_share=0.3)
    moved = [motion_under(Guide(), command, INERTIA, servo, steps=8)[0] for servo in (rigid, tiny)]
    assert np.std(moved[1] - moved[0]) < 0.01 * np.std(moved[0])


def test_friction_of_the_joint_holds_it_while_the_motor_crosses_the_play() -> None:
    command = np.concatenate([np.zeros(200), np.full(800, 0.5 * PLAY - 0.005)])
    servo = Servo(position_gain=GAIN, damping_gain=DAMPING, backlash=PLAY, rotor_share=0.5)
    position = motion_under(Guide(coulomb=0.2), command, INERTIA, servo, steps=8)[0]
    assert np.max(np.abs(position)) < 1e-3


def euler(command: Array, share: float, compliance: float) -> Array:
    """Return the angle of the link by explicit steps of 10 µs, rad, shape (ticks,)."""
    rotor, link = share * INERTIA, (1.0 - share) * INERTIA
    damping = 2.0 * 0.25 * np.sqrt(rotor * link / INERTIA / compliance)
    h, angles = 1e-5, np.empty(len(command))
    position, speed, angle, rate = 0.0, 0.0, 0.0, 0.0
    for tick, value in enumerate(command):
        angles[tick] = angle
        for _ in range(round(PERIOD / h)):
            wound = position - angle
            beyond = abs(wound) - 0.5 * PLAY
            side = 1.0 if wound > 0.0 else -1.0
            contact = beyond / compliance + damping * side * (speed - rate)
            contact = side * max(contact, 0.0) if beyond > 0.0 else 0.0
            speed += h * (GAIN * (value - position) - DAMPING * speed - contact) / rotor
            rate += h * contact / link
            position, angle = position + h * speed, angle + h * rate
    return angles


@pytest.mark.parametrize("share", [0.2, 0.6])
def test_a_gear_that_yields_moves_the_link_as_a_spring_and_a_damper_do(share: float) -> None:
    command, compliance = commanded(700), 0.004
    servo = Servo(
        position_gain=GAIN,
        damping_gain=DAMPING,
        backlash=PLAY,
        rotor_share=share,
        play_compliance=compliance,
    )
    true = euler(command, share, compliance)
    moved = [
        motion_under(Guide(), command, INERTIA, each, steps=32)[0]
        for each in (servo, servo._replace(play_compliance=0.0))
    ]
    yielding, rigid = (np.std(each - true) for each in moved)
    assert yielding < 0.03 * np.std(true)
    assert yielding < 0.3 * rigid


def test_a_load_winds_the_gear_up_by_its_compliance() -> None:
    servo = Servo(GAIN, DAMPING, backlash=PLAY, play_compliance=0.01)
    load = 2.0
    position = motion_under(Guide(offset=load), np.zeros(3000), INERTIA, servo, steps=8)[0]
    wound = 0.5 * PLAY + 0.01 * load
    assert abs(position[-1]) == pytest.approx(load / GAIN + wound, rel=1e-3)


@law_of("backlash", ForceActuator)
@pytest.mark.parametrize("share", [0.2, 0.6])
def test_a_motor_moves_its_joint_through_a_play_as_two_masses(share: float) -> None:
    torque, compliance, stiffness, damping = 2.0 * commanded(700), 0.002, 5.0, 0.05
    rotor, link = share * INERTIA, (1.0 - share) * INERTIA
    impact = 2.0 * 0.25 * np.sqrt(rotor * link / INERTIA / compliance)
    h, true = 1e-5, np.empty(len(torque))
    position, speed, angle, rate = 0.0, 0.0, 0.0, 0.0
    for tick, value in enumerate(torque):
        true[tick] = angle
        for _ in range(round(PERIOD / h)):
            wound = position - angle
            beyond, side = abs(wound) - 0.5 * PLAY, 1.0 if wound > 0.0 else -1.0
            contact = beyond / compliance + impact * side * (speed - rate)
            contact = side * max(contact, 0.0) if beyond > 0.0 else 0.0
            speed += h * (value - contact) / rotor
            rate += h * (contact - stiffness * angle - damping * rate) / link
            position, angle = position + h * speed, angle + h * rate
    motor = ForceActuator(backlash=PLAY, rotor_share=share, play_compliance=compliance)
    guide = Guide(stiffness=stiffness, viscous=damping)
    moved, rigid = (
        motion_under(guide, torque, INERTIA, each, steps=32)[0]
        for each in (motor, motor._replace(backlash=0.0))
    )
    assert np.std(moved - true) < 0.05 * np.std(true)
    assert np.std(moved - true) < 0.2 * np.std(rigid - true)
