"""Joints whose force is known without a column: those that nothing drives, and those that rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin import RigtwinError
from rigtwin.describing.checks import unforced_share
from tests.helpers.logs import write_log

FURUTA = """
<mujoco>
  <worldbody>
    <body name="arm">
      <joint name="arm" axis="0 0 1" armature="0.003"/>
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2" contype="0"/>
      <body name="rod" pos="0.2 0 0">
        <joint name="rod" axis="1 0 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.005" mass="0.1" contype="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="arm"/></actuator>
</mujoco>
"""
THREE = """
<mujoco>
  <worldbody>
    <body name="a">
      <joint name="a" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1" contype="0"/>
      <body name="b" pos="0.3 0 0">
        <joint name="b" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1" contype="0"/>
        <body name="c" pos="0.3 0 0">
          <joint name="c" axis="1 0 0"/>
          <geom type="box" pos="0.05 0.02 0" size="0.05 0.01 0.01" mass="0.5" contype="0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="a"/><motor joint="b"/><motor joint="c"/></actuator>
</mujoco>
"""
DOOR = """
<mujoco>
  <worldbody>
    <body name="leaf">
      <joint name="leaf" axis="0 0 1" stiffness="12" damping="4"/>
      <geom type="box" pos="0.4 0 1" size="0.4 0.02 1" mass="23" contype="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="leaf"/></actuator>
</mujoco>
"""
PERIOD = 0.004
TIME = PERIOD * np.arange(2500)


def simulated(xml: str, torques: np.ndarray, **changes: float) -> np.ndarray:
    """Return the positions of a model, shape (ticks, joints), with changed joint stiffness."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml)
    for name, stiffness in changes.items():
        model.joint(name).stiffness[0] = stiffness
    model.opt.timestep, model.opt.integrator = 0.5 * PERIOD, mujoco.mjtIntegrator.mjINT_RK4
    data, places = mujoco.MjData(model), []
    for torque in torques:
        places.append(data.qpos.copy())
        data.ctrl[:] = torque
        mujoco.mj_step(model, data, nstep=2)
    return np.array(places)


def test_the_force_at_a_joint_that_nothing_drives_is_zero(tmp_path: Path):
    torque = 0.03 * np.sin(5.0 * TIME) + 0.02 * np.sin(2.3 * TIME)
    places = simulated(FURUTA, torque[:, None], arm=0.15)
    noise = 2e-5 * np.random.default_rng(2).standard_normal(places.shape)
    (tmp_path / "model.xml").write_text(FURUTA)
    arm, rod = (places + noise).T
    columns = {"t": TIME, "arm_pos": arm, "rod_pos": rod, "motor_cmd_Nm": torque}
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.diagnose(log, machine=tmp_path / "model.xml")
    assert [str(effect.name) for effect in answer.effects] == ["stiffness@arm"]
    assert answer.effects[0].parameters["stiffness"].value == pytest.approx(0.15, rel=0.03)


def test_an_unmeasured_joint_that_nothing_drives_leaves_the_forces_unknown(tmp_path: Path):
    (tmp_path / "model.xml").write_text(FURUTA)
    torque = 0.03 * np.sin(5.0 * TIME)
    log = write_log(tmp_path / "log.csv", {"t": TIME, "arm_pos": torque, "motor_cmd_Nm": torque})
    assert rigtwin.describe(tmp_path / "model.xml", log).reading.kind.test == "force commands"


def test_the_force_at_a_joint_that_hardly_moves_is_not_judged(tmp_path: Path):
    (tmp_path / "model.xml").write_text(THREE)
    places = {"a": 0.8 * np.sin(2.0 * TIME), "b": np.sin(3.1 * TIME), "c": 2e-3 * np.sin(TIME)}
    columns = {"t": TIME, **{f"{name}_pos": place for name, place in places.items()}}
    columns |= {f"{name}_torque": np.cos(TIME + n) for n, name in enumerate("ab")}
    answer = rigtwin.describe(tmp_path / "model.xml", write_log(tmp_path / "log.csv", columns))
    assert answer.reading.resting == ("c",)
    assert 'resting = ["c"]' in answer.description
    assert [row.name for row in answer.machine.rows] == ["a_force", "b_force"]
    groups = {effect.group for effect in answer.machine.effects()}
    assert {"a", "b", "a_force", "a_rotor", "c_body"} <= groups
    assert not {"c", "c_force", "c_rotor", "c_warming", "c_position"} & groups


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('resting = "c"', "resting = c: expected a list of some of a, b, c, not all"),
        ('resting = ["a", "b", "c"]', "expected a list of some of a, b, c, not all"),
        ('resting = ["d"]', "expected a list of some of a, b, c, not all"),
    ],
)
def test_wrong_lists_of_resting_joints_are_refused(tmp_path: Path, line: str, said: str):
    (tmp_path / "model.xml").write_text(THREE)
    text = f"""
[machine]
name = "three"
model = "model.xml"
[[replays]]
test = "inverse dynamics"
{line}
"""
    (tmp_path / "machine.toml").write_text(text)
    with pytest.raises(RigtwinError, match=said.replace("[", r"\[")):
        rigtwin.machine(tmp_path / "machine.toml")


@pytest.mark.parametrize("is_push", [True, False])
def test_pushes_to_one_side_are_no_magnitudes(tmp_path: Path, is_push: bool):
    swing = np.sin(2.0 * TIME - 1.0)
    push = np.where(np.sin(2.0 * TIME) > 0.8, 20.0, 0.0)
    force = push if is_push else np.abs(np.round(20.0 * np.cos(2.0 * TIME)))
    assert unforced_share(force, swing) == pytest.approx(0.77 if is_push else 0.02, abs=0.02)
    (tmp_path / "model.xml").write_text(DOOR)
    log = write_log(tmp_path / "log.csv", {"t": TIME, "leaf_pos": swing, "leaf_force_Nm": force})
    if is_push:
        answer = rigtwin.describe(tmp_path / "model.xml", log)
        assert "leaf.force" in {signal.key for signal in answer.reading.signals}
    else:
        with pytest.raises(RigtwinError, match=r"no column is a measured force"):
            rigtwin.describe(tmp_path / "model.xml", log)


def test_a_held_command_acts_half_a_row_late(tmp_path: Path):
    (tmp_path / "model.xml").write_text(FURUTA)
    places = {"arm_pos": np.sin(TIME), "rod_pos": 0.3 * np.sin(1.7 * TIME)}
    log = write_log(tmp_path / "log.csv", {"t": TIME, **places, "motor_cmd_Nm": np.cos(TIME)})
    machine = rigtwin.describe(tmp_path / "model.xml", log).machine
    assert machine.plant.arm_force.delay == pytest.approx(-0.5 * PERIOD)
    assert machine.plant.rod_force.delay == 0.0
