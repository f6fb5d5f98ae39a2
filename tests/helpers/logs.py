"""Logs of an arm of two joints, as loggers of many kinds write them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from rigtwin.numerics.arrays import Array

ARM = """
<mujoco model="two joints">
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-2 2" limited="true" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" mass="2.0"/>
      <body name="lower" pos="0 0 -0.4">
        <joint name="elbow" axis="0 1 0" range="-2.5 2.5" limited="true" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1.0"/>
      </body>
    </body>
  </worldbody>
  {rest}
</mujoco>
"""
MOTORS = """<actuator>
    <motor name="shoulder_motor" joint="shoulder"/>
    <motor name="elbow_motor" joint="elbow"/>
  </actuator>"""
SERVOS = """<actuator>
    <position name="shoulder_servo" joint="shoulder" kp="80" kv="4"/>
    <position name="elbow_servo" joint="elbow" kp="40" kv="2"/>
  </actuator>"""
PERIOD, DURATION = 4e-3, 8.0
COULOMB = {"shoulder": 0.0, "elbow": 0.5}
"""Nm, dry friction that the model does not have."""


def write_arm(folder: Path, rest: str = "") -> Path:
    """Write the model of the arm, with actuators or without."""
    path = folder / "arm.xml"
    path.write_text(ARM.format(rest=rest))
    return path


def arm_motion(coulomb: Mapping[str, float] = COULOMB) -> dict[str, Array]:
    """Time, positions q1 and q2, speeds, and the torques tau1 and tau2 that the motion takes."""
    model = mujoco.MjModel.from_xml_string(ARM.format(rest=""))
    data = mujoco.MjData(model)
    time = np.arange(0.0, DURATION, PERIOD)
    place = np.stack(
        [
            0.9 * np.sin(2.1 * time) + 0.3 * np.sin(5.3 * time),
            0.8 * np.sin(3.3 * time) + 0.3 * np.sin(7.1 * time),
        ]
    )
    speed = np.gradient(place, PERIOD, axis=1)
    rate = np.gradient(speed, PERIOD, axis=1)
    torque = np.zeros_like(place)
    for tick in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = place[:, tick], speed[:, tick], rate[:, tick]
        mujoco.mj_inverse(model, data)
        torque[:, tick] = data.qfrc_inverse
    dry = np.array(list(coulomb.values()))[:, None]
    torque += dry * np.tanh(speed / 0.01)
    noise = np.random.default_rng(3)
    torque += 0.02 * noise.standard_normal(torque.shape)
    place = np.round(place / 1e-5) * 1e-5
    columns: dict[str, Array] = {"time": time}
    for number in range(2):
        columns[f"q{number + 1}"] = place[number]
        columns[f"dq{number + 1}"] = speed[number]
        columns[f"tau{number + 1}"] = torque[number]
    return columns


def write_log(path: Path, columns: Mapping[str, Array]) -> Path:
    """Write columns as a CSV."""
    values = np.column_stack(list(columns.values()))
    header = ",".join(columns)
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.9g")
    return path
