"""Models whose joints and actuators have no names of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from tests.helpers.logs import write_log

ARM = """<mujoco><option gravity="0 0 0"/><worldbody><body name="upper">
<joint axis="0 1 0" damping="0.1"/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
<body><joint name="wrist" axis="0 1 0"/><joint type="slide"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></body></worldbody>
<actuator><motor joint="wrist"/><motor joint="wrist"/></actuator></mujoco>"""
SHAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="rotor">
<joint axis="0 0 1" damping="0.01"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
</body></worldbody></mujoco>"""
PERIOD, INERTIA, DAMPING = 5e-3, 0.02, 0.03


def test_elements_without_a_name_are_named_after_what_they_belong_to(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    mechanism = Mechanism(tmp_path / "arm.xml")
    assert mechanism.names("joint") == ["upper_joint", "wrist", "body_joint"]
    assert mechanism.names("body") == ["world", "upper", "wrist_body"]
    assert mechanism.names("actuator") == ["wrist_actuator", "wrist_actuator_2"]


def test_a_model_without_names_is_diagnosed(tmp_path: Path) -> None:
    model = tmp_path / "shaft.xml"
    model.write_text(SHAFT)
    time = PERIOD * np.arange(2000)
    speed = 0.8 * np.cos(2.0 * time) + 0.9 * np.cos(9.0 * time)
    torque = DAMPING * speed - INERTIA * (1.6 * np.sin(2.0 * time) + 8.1 * np.sin(9.0 * time))
    angle = 0.4 * np.sin(2.0 * time) + 0.1 * np.sin(9.0 * time)
    noise = 1e-5 * np.random.default_rng(3).standard_normal((2, len(time)))
    columns = {"time": time, "angle": angle + noise[0], "torque": torque + noise[1]}
    answer = rigtwin.diagnose(write_log(tmp_path / "log.csv", columns), machine=model)
    (finding,) = answer.effects
    assert str(finding.name) == "viscous@rotor_joint"
    assert finding.parameters["viscous"].value == pytest.approx(DAMPING, rel=0.02)
    with pytest.raises(RigtwinError, match="give the joint that name"):
        answer.save_mjcf(tmp_path / "corrected.xml")
