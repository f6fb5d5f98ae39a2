"""Forces of an MJCF that are easily overlooked, in logs that MuJoCo itself computed."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.components import ForceActuator, component_of

ARM = """
<mujoco>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" stiffness="20" springref="30" damping="0.3"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1" contype="0"/>
      <body name="lower" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" stiffness="5" springref="-25" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.7" contype="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>
</mujoco>
"""
"""Two links whose springs are slack away from zero."""
LIFTED = """
<mujoco>
  <worldbody>
    <body name="upper" gravcomp="0.8">
      <joint name="shoulder" axis="0 1 0" damping="0.3"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1" contype="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/></actuator>
</mujoco>
"""
"""A link of which MuJoCo holds up four fifths of the weight."""


def log_of(path: Path, seconds: float = 10.0) -> dict[str, np.ndarray]:
    """Log of a motion with the torques that MuJoCo finds for it, and a little noise."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, time = mujoco.MjData(model), np.arange(0.0, seconds, 0.005)
    random = np.random.default_rng(3)
    motion = np.zeros((3, model.nv, len(time)))
    for joint in range(model.nv):
        for wave in range(4):
            rate = 2.0 * np.pi * (0.2 + 0.3 * wave + 0.07 * joint)
            size, phase = 0.4 / (wave + 1), random.uniform(0.0, 6.0) + rate * time
            motion[0, joint] += size * np.sin(phase)
            motion[1, joint] += size * rate * np.cos(phase)
            motion[2, joint] -= size * rate**2 * np.sin(phase)
    torques = np.empty((model.nv, len(time)))
    for tick in range(len(time)):
        data.qpos, data.qvel, data.qacc = motion[:, :, tick]
        mujoco.mj_inverse(model, data)
        torques[:, tick] = data.qfrc_inverse
    log = {"time": time}
    for joint in range(model.nv):
        name, noise = model.joint(joint).name, random.standard_normal((2, len(time)))
        log[f"{name}_pos"] = motion[0, joint] + 1e-4 * noise[0]
        log[f"{name}_torque"] = torques[joint] + 0.01 * noise[1]
    return log


@pytest.mark.parametrize("xml", [ARM, LIFTED], ids=["springs", "gravcomp"])
def test_a_model_that_is_right_has_no_gap(tmp_path: Path, xml: str):
    path = tmp_path / "arm.xml"
    path.write_text(xml)
    assert rigtwin.diagnose(log_of(path), machine=path).verdict == "no gap"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<worldbody>", '<option><flag damper="disable"/></option><worldbody>', "flag damper"),
        ("<worldbody>", '<option actuatorgroupdisable="0"/><worldbody>', "actuatorgroupdisable"),
        ('name="elbow"', 'name="elbow" actuatorfrcrange="-1 2"', "elbow: its actuatorfrcrange"),
        (
            "<actuator>",
            '<tendon><fixed name="cord" limited="true" range="-1 1"><joint joint="elbow" coef="1"/>'
            "</fixed></tendon><actuator>",
            "cord: the limits of its length",
        ),
    ],
)
def test_what_is_not_modelled_is_said(tmp_path: Path, old: str, new: str, said: str):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace(old, new, 1))
    model = path.read_text()
    assert new in model
    right = tmp_path / "right.xml"
    right.write_text(ARM)
    described = rigtwin.describe(path, log_of(right, 4.0))
    assert any(said in line for line in described.machine.overlooked)


def test_the_medium_of_a_single_joint_is_not_modelled(tmp_path: Path):
    path = tmp_path / "arm.xml"
    path.write_text(LIFTED.replace("<worldbody>", '<option density="1000"/><worldbody>'))
    described = rigtwin.describe(path, log_of(path, 4.0))
    assert any("medium" in line for line in described.machine.overlooked)


COMMANDED = """
<mujoco>
  <option timestep="0.0005"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.5"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1" contype="0"/>
      <body name="lower" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" damping="0.2"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.7" contype="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>{shoulder}<motor name="elbow" joint="elbow"/></actuator>
</mujoco>
"""
"""Two links, with the actuators' commands in the log."""


def commanded(path: Path, seconds: float = 6.0) -> dict[str, np.ndarray]:
    """Log of the commands of all actuators, and of the motion that MuJoCo simulates for them."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, random = mujoco.MjData(model), np.random.default_rng(5)
    steps, ticks = round(0.005 / model.opt.timestep), round(seconds / 0.005)
    log = {"time": 0.005 * np.arange(ticks)}
    names = [model.actuator(number).name for number in range(model.nu)]
    phases = random.uniform(0.0, 6.0, (2, model.nu))
    for number, name in enumerate(names):
        slow, fast = (2.0 * np.pi * rate * log["time"] for rate in (0.4 + 0.2 * number, 1.3))
        log[f"{name}_cmd"] = 0.6 * np.sin(slow + phases[0, number])
        log[f"{name}_cmd"] += 0.3 * np.sin(fast + phases[1, number])
        # A filter has no memory of a command before the log.
        log[f"{name}_cmd"] *= np.minimum(log["time"], 1.0)
    angles = np.empty((2, ticks))
    for tick in range(ticks):
        angles[:, tick] = data.qpos
        data.ctrl = [log[f"{name}_cmd"][tick] for name in names]
        mujoco.mj_step(model, data, steps)
    for joint, angle in zip(("shoulder", "elbow"), angles, strict=True):
        log[f"{joint}_pos"] = angle + 5e-4 * random.standard_normal(ticks)
    return log


@pytest.mark.slow
@pytest.mark.parametrize(
    "shoulder",
    [
        '<motor name="shoulder" joint="shoulder"/>',
        '<motor name="shoulder" joint="shoulder" ctrlrange="-0.5 0.5"/>',
        '<motor name="shoulder" joint="shoulder" forcerange="-0.5 0.5"/>',
        '<general name="shoulder" joint="shoulder" dyntype="filter" dynprm="0.15"/>',
        '<motor name="shoulder" joint="shoulder" delay="0.05" nsample="200"/>',
    ],
    ids=["plain", "ctrlrange", "forcerange", "filter", "delay"],
)
def test_an_actuator_does_with_a_command_what_its_model_says(tmp_path: Path, shoulder: str):
    path = tmp_path / "arm.xml"
    path.write_text(COMMANDED.format(shoulder=shoulder))
    assert rigtwin.diagnose(commanded(path), machine=path).verdict == "no gap"


def test_the_range_of_a_joint_limits_the_force_of_its_only_actuator(tmp_path: Path):
    path = tmp_path / "arm.xml"
    motor = '<motor name="shoulder" joint="shoulder" gear="2"/>'
    xml = COMMANDED.format(shoulder=motor).replace(
        'name="shoulder" axis', 'name="shoulder" actuatorfrcrange="-1.5 1.5" axis', 1
    )
    path.write_text(xml)
    described = rigtwin.describe(path, commanded(path, 3.0), test="force commands")
    assert not any("actuatorfrcrange" in line for line in described.machine.overlooked)
    motor = component_of(described.machine.plant, "shoulder_actuator", ForceActuator)
    assert motor.force_limit == 1.5


def test_a_second_motor_of_a_joint_is_not_forgotten(tmp_path: Path):
    path = tmp_path / "arm.xml"
    motors = '<motor name="shoulder" joint="shoulder"/><motor name="boost" joint="shoulder"/>'
    path.write_text(COMMANDED.format(shoulder=motors))
    columns = {"shoulder.command": "shoulder_cmd"}
    described = rigtwin.describe(path, commanded(path, 3.0), columns=columns)
    assert described.reading.kind.test == "force commands"
    assert any("actuator boost: its command" in line for line in described.machine.overlooked)
