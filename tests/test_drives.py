"""Logs with the commands and the forces of servos, which may err where the forces are right."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from tests.helpers.logs import write_log

MODEL = """<mujoco><compiler angle="radian"/><option timestep="0.0002" integrator="RK4"/>
<worldbody><body name="blade"><joint name="pitch" type="hinge" axis="0 1 0" damping="0.4"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="0.03 0.03 0.03"/></body></worldbody>
<actuator><position name="drive" joint="pitch" kp="20" kv="2"/></actuator></mujoco>"""
EVERY, ROWS, LAG = 50, 1200, 0.15
GAIN, DAMPING = 20.0, 2.0


def swing(folder: Path, lag: float) -> Path:
    """Write a log at 100 Hz under commands that pass a first-order lag, s."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, random = mujoco.MjData(model), np.random.default_rng(2)
    step = model.opt.timestep
    rows, held = [], 0.0
    for row in range(ROWS):
        time = row * EVERY * step
        command = 0.4 * np.sin(1.3 * time) + 0.3 * np.sin(4.0 * time) + 0.2 * np.sin(9.0 * time)
        torque = GAIN * (held - data.qpos[0]) - DAMPING * data.qvel[0]
        noise = random.standard_normal(2)
        rows.append([time, command, data.qpos[0] + 1e-4 * noise[0], torque + 0.02 * noise[1]])
        for _ in range(EVERY):
            data.ctrl[0] = held
            mujoco.mj_step(model, data)
            held += (command - held) * step / lag
    names = ("time", "command", "angle", "torque")
    return write_log(folder / "log.csv", dict(zip(names, np.array(rows).T, strict=True)))


@pytest.mark.slow
def test_a_lag_of_a_servo_is_found_beside_right_forces(tmp_path: Path) -> None:
    (tmp_path / "blade.xml").write_text(MODEL)
    answer = rigtwin.diagnose(
        swing(tmp_path, LAG), machine=tmp_path / "blade.xml", columns={"*.position": "[rad]"}
    )
    assert [str(effect.name) for effect in answer.effects] == ["lag@drive"]
    (parameter,) = answer.effects[0].parameters.values()
    assert parameter.value == pytest.approx(LAG, rel=0.05)
    assert "the forces along the measured motion show no gap" in answer.answer.notes[0]
