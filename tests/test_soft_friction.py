"""Dry friction as MuJoCo simulates it: soft, and early to reverse."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.components.guide import Guide
from rigtwin.components.guide_step import guide_step_of
from rigtwin.description.mechanism import Mechanism
from rigtwin.models.joint_inverse import resist, resist_at_once

ARM = """
<mujoco>
  <option timestep="0.0005"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" damping="0.3" frictionloss="1.5"/>
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
      <body pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.2" frictionloss="0.9"/>
        <inertial pos="0.15 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="m1" joint="shoulder"/><motor name="m2" joint="elbow"/></actuator>
</mujoco>
"""
TICK, SECONDS = 0.002, 10.0
GAINS, DAMPING = np.array([300.0, 120.0]), np.array([12.0, 5.0])


def _log(seed: int) -> dict[str, np.ndarray]:
    """A controlled arm that MuJoCo simulates, with noise."""
    model = mujoco.MjModel.from_xml_string(ARM)
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    frequency = random.uniform(0.2, 0.9, (2, 3))
    phase, held = random.uniform(0.0, 6.0, (2, 3)), round(TICK / model.opt.timestep)
    rows = []
    for tick in range(round(SECONDS / TICK)):
        angle = 2.0 * np.pi * frequency * tick * TICK + phase
        target = np.array([-1.2, 0.8]) + 0.3 * np.sin(angle).sum(axis=1)
        speed = 0.6 * np.pi * (frequency * np.cos(angle)).sum(axis=1)
        if tick == 0:
            data.qpos[:], data.qvel[:] = target, speed
        mujoco.mj_forward(model, data)
        position = data.qpos + 2e-5 * random.standard_normal(2)
        data.ctrl[:] = data.qfrc_bias + GAINS * (target - position) + DAMPING * (speed - data.qvel)
        rows.append([tick * TICK, *position, *(data.ctrl + 0.02 * random.standard_normal(2))])
        mujoco.mj_step(model, data, held)
    names = ("time", "shoulder_pos", "elbow_pos", "shoulder_tau", "elbow_tau")
    return dict(zip(names, np.array(rows).T, strict=True))


@pytest.mark.slow
def test_an_arm_that_mujoco_simulates_has_no_gap(tmp_path: Path) -> None:
    """Its friction is soft, which is no defect of the machine."""
    (tmp_path / "arm.xml").write_text(ARM)
    answer = rigtwin.diagnose(_log(1), machine=tmp_path / "arm.xml", held_out=_log(2))
    assert answer.verdict == "no gap"


@pytest.mark.parametrize("kernel", [resist, resist_at_once])
@pytest.mark.parametrize("softness", [0.0, 0.5, 1.0])
def test_soft_friction_is_that_of_the_constraint(kernel, softness: float) -> None:
    """F_soft = (v + T v')/(R T) within the limits, and F = F_dry + s (F_soft - F_dry)."""
    period, soft_time, soft_speed = 1e-3, 0.0095, 0.02
    angle = 2.0 * np.pi * 0.7 * period * np.arange(4000)
    rate = 2.0 * np.pi * 0.7
    motion = np.stack([np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle)])
    guide = Guide(
        coulomb=3.0,
        viscous=0.4,
        softness=softness,
        soft_time=soft_time,
        soft_speed=soft_speed,
    )
    force = np.zeros(len(angle))
    kernel(guide_step_of(guide, 1e7, 0.0, period), motion, force)
    soft = np.clip((motion[1] + soft_time * motion[2]) / soft_speed, -3.0, 3.0)
    dry = 3.0 * np.sign(motion[1])
    wrong = np.abs(force - 0.4 * motion[1] - dry - softness * (soft - dry)) > 1e-3
    # Each reversal of the sharp part may be a tick late, and its spring is slack at the start.
    assert np.count_nonzero(wrong[10:]) <= 12


def test_a_model_states_how_soft_its_friction_is(tmp_path: Path) -> None:
    """T = dmax timeconst / 2, and R = (1 - d)/d of the joint's inverse inertia."""
    text = ARM.replace('frictionloss="0.9"', 'frictionloss="0.9" solreffriction="0.004 1"')
    (tmp_path / "arm.xml").write_text(text)
    friction = Mechanism(tmp_path / "arm.xml").friction("joint", "elbow")
    weight = mujoco.MjModel.from_xml_string(text).dof_invweight0[1]
    assert friction["soft_time"] == pytest.approx(0.95 * 0.004 / 2.0)
    assert friction["soft_speed"] == pytest.approx(friction["soft_time"] * weight / 9.0)
