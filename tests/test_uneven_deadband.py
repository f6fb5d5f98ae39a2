"""A drive whose deadband differs by direction, made by plain MuJoCo and a law of two lines."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.recording import RecordedTest

MODEL = """
<mujoco>
  <option gravity="0 0 -9.81" timestep="2.5e-4" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="axis" axis="0 1 0" damping="0.08"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><motor name="valve" joint="axis" gear="1"/></actuator>
  <sensor><jointpos name="angle" joint="axis"/></sensor>
</mujoco>
"""
TOML = """
[machine]
name = "valve-arm"
title = "an arm behind a valve"
model = "arm.xml"
nominal = "{nominal}"
[components]
arm = {{ body = "arm", effects = [] }}
bearing = {{ joint = "axis", effects = ["coulomb", "viscous", "asymmetry", "offset"] }}
valve = {{ actuator = "valve", command = "torque" }}
encoder = {{ sensor = "angle", channel = "angle", white = 2e-4, effects = ["offset"] }}
[[replays]]
name = "pushed"
moved_by = "valve"
observe = ["encoder"]
"""
PERIOD, DURATION = 2e-3, 20.0
SLOW = pytest.mark.slow


def through(command: float, forward: float, backward: float) -> float:
    return max(command - forward, 0.0) + min(command + backward, 0.0)


def recorded(forward: float, backward: float, seed: int) -> RecordedTest:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    time = np.arange(round(DURATION / PERIOD)) * PERIOD
    phases = random.uniform(0.0, 6.28, 5)
    speeds = np.array([0.9, 1.7, 2.6, 3.9, 5.3])
    torque = 0.08 * np.sin(np.outer(time, speeds) + phases).sum(axis=1) * np.minimum(time, 1.0)
    angles = np.empty(len(time))
    for tick in range(len(time)):
        angles[tick] = data.qpos[0]
        data.ctrl[0] = through(float(torque[tick]), forward, backward)
        for _ in range(round(PERIOD / model.opt.timestep)):
            mujoco.mj_step(model, data)
    angles += random.normal(0.0, 2e-4, len(time))
    return RecordedTest(
        path=Path("valve"),
        machine="valve-arm",
        experiment="",
        period=PERIOD,
        time=time,
        columns={"/command": {"torque": torque}, "/sensor": {"angle": angles}},
        controller={},
    )


def diagnosed(folder: Path, forward: float, backward: float, nominal: str) -> rigtwin.Diagnosis:
    (folder / "arm.xml").write_text(MODEL)
    (folder / "arm.toml").write_text(TOML.format(nominal=nominal))
    machine = rigtwin.machine(folder / "arm.toml")
    tests = [recorded(forward, backward, seed) for seed in (1, 2)]
    return rigtwin.diagnose(tests[0], machine=machine, held_out=tests[1])


NOMINAL = pytest.mark.parametrize("nominal", ["known", pytest.param("rough", marks=SLOW)])


@pytest.mark.slow
@NOMINAL
def test_one_that_differs_by_direction_is_found(tmp_path, nominal):
    answer = diagnosed(tmp_path, 0.08, 0.02, nominal)
    (effect,) = answer.effects
    assert str(effect.name) == "deadband_asymmetry@valve"
    assert answer.verdict == "explained"
    assert effect.parameters["deadband"].value == pytest.approx(0.05, rel=0.03)
    assert effect.parameters["deadband_asymmetry"].value == pytest.approx(0.06, rel=0.05)


@pytest.mark.slow
@NOMINAL
def test_an_even_one_stays_one(tmp_path, nominal):
    answer = diagnosed(tmp_path, 0.05, 0.05, nominal)
    (effect,) = answer.effects
    assert str(effect.name) == "deadband@valve"
    assert len(effect.alternatives) == 1, "the uneven one is no rival: it contains the even one"
    assert effect.parameters["deadband"].value == pytest.approx(0.05, rel=0.03)


def test_where_there_is_none_none_is_named(tmp_path):
    assert diagnosed(tmp_path, 0.0, 0.0, "known").verdict == "no gap"
