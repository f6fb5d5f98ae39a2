"""Joints that act on each other although their mass matrix is diagonal."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.description.coupling import are_coupled
from rigtwin.description.mechanism import Mechanism
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

MODEL = """<mujoco><option gravity="0 0 0"/><worldbody><body name="first">
<joint name="one" {one} damping="0.03"/><inertial pos="0 0 0" mass="1" diaginertia="{first}"/>
<body name="second"><joint name="two" {two} damping="0.02"/>
<inertial pos="{place}" mass="1" diaginertia="{second}"/></body></body></worldbody></mujoco>"""
PAN_TILT = {"one": 'axis="0 0 1"', "two": 'axis="0 1 0"', "place": "0 0 0"}
POLAR = {"one": 'axis="0 0 1"', "two": 'type="slide" axis="1 0 0"', "place": "0.5 0 0"}
GANTRY = {**POLAR, "one": 'type="slide" axis="0 1 0"'}
FIRST, LONG, ROUND = "0.01 0.01 0.01", "0.002 0.004 0.005", "0.004 0.004 0.004"
COGGING, PITCH = 0.02, 0.3


def write(folder: Path, joints: dict[str, str], second: str) -> Path:
    path = folder / "model.xml"
    path.write_text(MODEL.format(**joints, first=FIRST, second=second))
    return path


@pytest.mark.parametrize(
    ("joints", "second", "coupled"),
    [(PAN_TILT, LONG, True), (PAN_TILT, ROUND, False), (POLAR, LONG, True), (GANTRY, LONG, False)],
)
def test_an_inertia_that_depends_on_another_joint_couples_both(
    tmp_path: Path, joints: dict[str, str], second: str, coupled: bool
) -> None:
    assert are_coupled(Mechanism(write(tmp_path, joints, second)), ["one", "two"]) is coupled


def torques(path: Path, angles: Array, speeds: Array, accelerations: Array) -> Array:
    """Torques by MuJoCo's inverse dynamics, shape (2, rows)."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, found = mujoco.MjData(model), []
    for data.qpos, data.qvel, data.qacc in zip(angles.T, speeds.T, accelerations.T, strict=True):
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found).T


@pytest.mark.slow
def test_waves_along_a_coupled_joint_are_found_and_none_where_there_are_none(
    tmp_path: Path,
) -> None:
    model, random = write(tmp_path, PAN_TILT, LONG), np.random.default_rng(5)
    time = 2e-3 * np.arange(5000)
    rates, sizes = np.array([[1.4, 5.0], [1.9, 6.1]]), np.array([[1.2, 0.15], [0.6, 0.1]])
    waves = rates[:, :, None] * time
    angles = (sizes[:, :, None] * np.sin(waves)).sum(1)
    speeds = ((sizes * rates)[:, :, None] * np.cos(waves)).sum(1)
    found = torques(model, angles, speeds, -((sizes * rates**2)[:, :, None] * np.sin(waves)).sum(1))
    noise = random.standard_normal((4, len(time)))
    cogging = COGGING * np.sin(2.0 * np.pi * angles[0] / PITCH + 0.4)
    for size in (0.0, 1.0):
        columns = {
            "time": time,
            "one_pos": angles[0] + 2e-5 * noise[0],
            "two_pos": angles[1] + 2e-5 * noise[1],
            "one_torque": found[0] + size * cogging + 2e-4 * noise[2],
            "two_torque": found[1] + 2e-4 * noise[3],
        }
        answer = rigtwin.diagnose(write_log(tmp_path / "log.csv", columns), machine=model)
        assert [str(effect.name) for effect in answer.effects] == ["cogging@one"] * int(size)
        for effect in answer.effects:
            assert effect.parameters["cogging"].value == pytest.approx(COGGING, rel=0.03)
            assert effect.parameters["cogging_pitch"].value == pytest.approx(PITCH, rel=0.01)
        assert answer.verdict == ("explained" if size else "no gap")
