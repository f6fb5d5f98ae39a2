"""Nothing moved, nothing learned: a bound on friction, and no values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin

MODEL = """<mujoco model="stuck"><compiler angle="radian"/><worldbody><body name="arm">
<joint name="hinge" axis="0 0 1" damping="0.01"/>
<inertial pos="0.1 0 0" mass="0.5" diaginertia="0.001 0.001 0.002"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator>
<sensor><jointpos name="enc" joint="hinge"/></sensor></mujoco>"""
COLUMNS = {"hinge.command": "torque"}
TIME = np.arange(2000) * 0.002
TORQUE = 0.2 * np.sin(2 * np.pi * 0.75 * TIME)
RANDOM = np.random.default_rng(1)
POSITIONS = {
    "noise": 0.3 + 1e-4 * RANDOM.standard_normal(len(TIME)),
    "one value": np.full(len(TIME), 0.3),
    "two values": 0.3 + np.where(RANDOM.uniform(size=len(TIME)) > 0.5, 0.0, 1e-3),
}


def diagnose(folder: Path, position: np.ndarray) -> rigtwin.Diagnosis:
    (folder / "model.xml").write_text(MODEL)
    rows = np.column_stack([TIME, TORQUE, position])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="time,torque,hinge_pos", comments="")
    return rigtwin.diagnose(folder / "log.csv", machine=folder / "model.xml", columns=COLUMNS)


@pytest.mark.parametrize("sort", POSITIONS)
def test_a_joint_that_never_moved_gives_a_bound_and_no_name(tmp_path: Path, sort: str):
    answer = diagnose(tmp_path, POSITIONS[sort])
    assert answer.verdict == "unknown"
    assert answer.effects == ()
    assert "Nothing moved" in answer.sentence
    assert "up to 0.2 Nm" in answer.sentence
    assert answer.report(tmp_path / "why.html").exists()


def test_a_joint_that_creeps_did_move(tmp_path: Path):
    position = POSITIONS["noise"] + 2e-3 * np.sin(2 * np.pi * 0.75 * TIME)
    assert "Nothing moved" not in diagnose(tmp_path, position).sentence
