"""A gap in a spring between two joints, as in a screw's nut, beside MuJoCo's own."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from tests.helpers.logs import write_log

MODEL = """<mujoco><option timestep="0.0005" integrator="RK4" gravity="0 0 0"/><worldbody>
<body name="nut"><joint name="nut" type="slide" axis="1 0 0" damping="4"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
<body name="table" pos="0 0 1"><joint name="table" type="slide" axis="1 0 0" damping="6"/>
<inertial pos="0 0 0" mass="3" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<tendon><fixed name="drive" stiffness="8000" damping="20" springlength="{length}">
<joint joint="nut" coef="1"/><joint joint="table" coef="-1"/></fixed></tendon>
<actuator><motor name="motor" joint="nut"/></actuator></mujoco>"""
GAP, EVERY, ROWS = 0.004, 4, 2000


def play(folder: Path, seed: int) -> Path:
    """Write a log of the axis with a gap in its drive, at 500 Hz."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(length=f"{-0.5 * GAP} {0.5 * GAP}"))
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    phases = random.uniform(0.0, 6.28, 3)
    columns = {"time": [], "motor": [], "nut": [], "table": []}
    for row in range(ROWS):
        time = row * EVERY * model.opt.timestep
        data.ctrl[0] = 12.0 * np.sin(np.array([5.0, 8.3, 13.1]) * time + phases).sum()
        columns["time"].append(time)
        columns["motor"].append(data.ctrl[0])
        columns["nut"].append(data.qpos[0] + 2e-5 * random.standard_normal())
        columns["table"].append(data.qpos[1] + 2e-5 * random.standard_normal())
        mujoco.mj_step(model, data, EVERY)
    return write_log(folder / f"{seed}.csv", {k: np.array(v) for k, v in columns.items()})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("slack")
    (folder / "tight.xml").write_text(MODEL.format(length="0"))
    (folder / "loose.xml").write_text(MODEL.format(length=f"{-0.5 * GAP} {0.5 * GAP}"))
    return folder


def test_a_gap_that_the_model_states_is_no_gap_of_the_twin(folder: Path) -> None:
    answer = rigtwin.diagnose(
        play(folder, 3), machine=folder / "loose.xml", columns={"*.position": "[m]"}
    )
    assert answer.verdict == "no gap"


@pytest.mark.slow
def test_a_hidden_gap_is_found_and_written_into_the_model(folder: Path, tmp_path: Path) -> None:
    answer = rigtwin.diagnose(
        play(folder, 1),
        machine=folder / "tight.xml",
        held_out=play(folder, 2),
        columns={"*.position": "[m]"},
    )
    assert [str(effect.name) for effect in answer.effects] == ["slack@drive"]
    (parameter,) = answer.effects[0].parameters.values()
    assert parameter.value == pytest.approx(GAP, rel=0.03)
    answer.save_mjcf(tmp_path / "corrected.xml")
    corrected = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    assert np.ptp(corrected.tendon_lengthspring[0]) == pytest.approx(parameter.value, rel=1e-5)


def test_a_joint_without_a_spring_is_not_searched_for_slack(folder: Path) -> None:
    answer = rigtwin.describe(folder / "tight.xml", play(folder, 1), columns={"*.position": "[m]"})
    slack = [e.name for e in answer.machine.effects() if e.kind.name == "slack"]
    assert slack == ["slack@drive"]
