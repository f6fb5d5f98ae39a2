"""An inverted pendulum that a controller balances: a recording that no simulation from its start
alone can follow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import rigtwin

MODEL = """<mujoco model="balanced"><option timestep="0.001"/><worldbody>
<body name="cart"><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
<joint name="slider" type="slide" axis="1 0 0" damping="0.05"/>
<body name="pole"><inertial pos="0 0 0.5" mass="0.1" diaginertia="0.0083 0.0083 0.0001"/>
<joint name="hinge" type="hinge" axis="0 1 0" damping="1e-4"/></body></body></worldbody>
<actuator><motor name="drive" joint="slider" gear="10"/></actuator></mujoco>"""
TICK, SECONDS, NOISE = 10, 8.0, (2e-4, 1e-3)


def gains(model: mujoco.MjModel) -> np.ndarray:
    """Gains of a linear-quadratic regulator at 100 Hz, shape (4,)."""
    nominal, size = mujoco.MjModel.from_xml_string(MODEL), 2 * model.nv
    nominal.opt.timestep = 0.01
    a, b = np.zeros((size, size)), np.zeros((size, 1))
    mujoco.mjd_transitionFD(nominal, mujoco.MjData(nominal), 1e-6, True, a, b, None, None)
    cost = solve_discrete_are(a, b, np.diag([10.0, 1.0, 1.0, 0.1]), np.eye(1))
    return np.linalg.solve(np.eye(1) + b.T @ cost @ b, b.T @ cost @ a)[0]


def balance(folder: Path, change: Callable[[mujoco.MjModel], None]) -> Path:
    """Write a log of commands and angles under the regulator, at 100 Hz."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    feedback = gains(model)
    change(model)
    data, random = mujoco.MjData(model), np.random.default_rng(5)
    data.qpos[1], rows = 0.1, []
    for tick in range(round(SECONDS / (TICK * model.opt.timestep))):
        time = tick * TICK * model.opt.timestep
        goal = 0.3 * np.sin(0.9 * time) + 0.15 * np.sin(2.7 * time + 1.0)
        error = np.concatenate([data.qpos - [goal, 0.0], data.qvel])
        data.ctrl[0] = np.clip(-feedback @ error, -1.0, 1.0)
        rows.append([time, data.ctrl[0], *(data.qpos + NOISE * random.standard_normal(2))])
        mujoco.mj_step(model, data, TICK)
    path = folder / "log.csv"
    np.savetxt(path, rows, "%.6f", ",", header="time,drive,slider,hinge", comments="")
    return path


def friction(model: mujoco.MjModel) -> None:
    model.dof_frictionloss[0] = 1.0


@pytest.mark.slow
@pytest.mark.parametrize("test", ["inverse dynamics", "force commands"])
def test_friction_is_found_under_feedback(tmp_path: Path, test: str) -> None:
    (tmp_path / "balanced.xml").write_text(MODEL)
    answer = rigtwin.diagnose(
        balance(tmp_path, friction),
        machine=tmp_path / "balanced.xml",
        columns={"*.position": "[rad]"},
        test=test,
    )
    assert [str(found.name) for found in answer.effects] == ["coulomb@slider"]
    (parameter,) = answer.effects[0].parameters.values()
    assert parameter.value == pytest.approx(1.0, rel=0.03)
    # Along the measured motion nothing grows, and no windows are needed.
    windows = any("windows" in note for note in answer.answer.notes)
    assert windows == (test == "force commands")
