"""Play between a servo's motor and the joint, beside the same play as a limited joint of MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rigtwin.components import Guide, Servo
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
