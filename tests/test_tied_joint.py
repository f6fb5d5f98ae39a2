"""A joint that is replayed alone, and carries along the joints that are tied to it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.components import with_parameters
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError

LIFT = """
<mujoco>
  <worldbody>
    <body name="carriage">
      <joint name="lift" type="slide" axis="0 0 1" armature="7.5"/>
      <inertial pos="0 0 0" mass="46" diaginertia="1 1 1"/>
    </body>
    <body name="counterweight">
      <joint name="rope" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="38" diaginertia="1 1 1"/>
    </body>
  </worldbody>
  <equality><joint joint1="rope" joint2="lift" polycoef="0 {ratio} 0 0 0"/></equality>
</mujoco>
"""


@pytest.mark.parametrize("ratio", [-1.0, -0.5, 2.0])
def test_a_tied_joint_adds_its_inertia_and_weight(tmp_path: Path, ratio: float) -> None:
    """M = m + r^2 m_tied and G = (m + r m_tied) g, for q_tied = r q."""
    (tmp_path / "lift.xml").write_text(LIFT.format(ratio=ratio))
    joint = Mechanism(tmp_path / "lift.xml").joint("lift")
    assert joint.inertia == pytest.approx(46.0 + 7.5 + 38.0 * ratio**2)
    assert joint.gravity == pytest.approx([9.81 * (46.0 + 38.0 * ratio)] * len(joint.gravity))


def test_a_load_on_a_balanced_lift_has_its_whole_weight(tmp_path: Path) -> None:
    """A mass m more needs the force m (g + a), whatever the counterweight balances."""
    (tmp_path / "lift.xml").write_text(
        LIFT.format(ratio=-1).replace(
            "</mujoco>", '<actuator><motor name="drive" joint="lift"/></actuator></mujoco>'
        )
    )
    time = 0.002 * np.arange(4000)
    acceleration = 2.0 * np.sin(5.0 * time)
    log = {
        "time": time,
        "lift_position": -acceleration / 25.0,
        "lift_force": 91.5 * acceleration + 78.48,
    }
    described = rigtwin.describe(tmp_path / "lift.xml", log)
    recording = described.record()
    configuration = described.machine.configuration_of(recording)
    model = described.machine.physics.model(described.machine, recording.inputs, configuration, 1)
    plant = configuration.plant
    (mass,) = [name for name in described.machine.components if name == "carriage"]
    heavier = with_parameters(plant, mass, {"mass": 84.0 + 6.0})
    change = (model.predict(heavier) - model.predict(plant))[0]
    inside = slice(400, -400)
    expected = 6.0 * (9.81 + acceleration)
    assert np.max(np.abs(change - expected)[inside]) < 0.02 * np.max(expected)


FINGER = """
<mujoco>
  <default><joint damping="0.02" armature="1e-3"/></default>
  <worldbody>
    <body name="middle"><joint name="PIP" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .03 0 0" size=".008"/>
      <body name="distal" pos=".03 0 0"><joint name="DIP" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .02 0 0" size=".007"/></body></body>
  </worldbody>
  <equality><joint joint1="DIP" joint2="PIP" polycoef="0 0.7 0 0 0"/></equality>
  <actuator><position name="servo" joint="PIP" kp="2" kv="0.05"/></actuator>
</mujoco>
"""


MOTORS = '<motor name="drive_1" joint="MCP"/><motor name="drive_2" joint="PIP"/>'


def test_a_measured_joint_that_follows_a_servo_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "finger.xml").write_text(FINGER)
    time = 0.004 * np.arange(1000)
    angle = 0.5 * np.sin(3.0 * time) + 0.2 * np.sin(7.0 * time)
    log = {"time": time, "cmd_PIP": angle, "meas_PIP": angle, "meas_DIP": 0.7 * angle}
    described = rigtwin.describe(tmp_path / "finger.xml", log)
    assert described.reading.joints == ("PIP",)
    assert "DIP: it follows PIP by an equality" in described.reading.notes


def test_a_follower_is_asked_for_where_the_forces_of_several_joints_are_judged(
    tmp_path: Path,
) -> None:
    base = '<body name="base"><joint name="MCP" axis="0 1 0"/><geom size=".01"/><body name="middle"'
    arm = FINGER.replace('<body name="middle"', base).replace("</worldbody>", "</body></worldbody>")
    arm = arm.replace('<position name="servo" joint="PIP" kp="2" kv="0.05"/>', MOTORS)
    (tmp_path / "finger.xml").write_text(arm)
    time = 0.004 * np.arange(1000)
    angle = 0.5 * np.sin(3.0 * time) + 0.2 * np.sin(7.0 * time)
    place = np.outer(angle, [1.0, -0.8, 0.7])
    model = mujoco.MjModel.from_xml_string(arm)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, torques = mujoco.MjData(model), []
    speed = np.gradient(place, time, axis=0)
    for data.qpos, data.qvel, data.qacc in zip(
        place, speed, np.gradient(speed, time, axis=0), strict=True
    ):
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse.copy())
    log = {
        "time": time,
        "MCP_torque": np.array(torques)[:, 0],
        "PIP_torque": np.array(torques)[:, 1],
    }
    log |= {f"{name}_pos": place[:, n] for n, name in enumerate(("MCP", "PIP", "DIP"))}
    with pytest.raises(RigtwinError, match="DIP"):
        rigtwin.describe(tmp_path / "finger.xml", log)
