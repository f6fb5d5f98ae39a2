"""End stops that nobody described: found in the motion of MuJoCo's own joint limits."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin

MODEL = """<mujoco model="stopped"><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="carriage"><joint name="axis" type="slide" axis="1 0 0" damping="20"{limits}/>
<inertial pos="0 0 0" mass="1.5" diaginertia="1e-3 1e-3 1e-3"/></body></worldbody>
<actuator><motor name="coil" joint="axis"/></actuator></mujoco>"""
TICK, SECONDS, NOISE = 5, 6.0, 1e-5


def drive(folder: Path, limits: str) -> Path:
    """Write a log of the force and the position of a carriage, at 200 Hz."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(limits=limits))
    data, random = mujoco.MjData(model), np.random.default_rng(4)
    rows = []
    for tick in range(round(SECONDS / (TICK * model.opt.timestep))):
        time = tick * TICK * model.opt.timestep
        data.ctrl[0] = (
            2.4 * np.sin(4.4 * time) + 2.4 * np.sin(1.9 * time) + 2.0 * np.sin(9.0 * time)
        )
        rows.append([time, data.ctrl[0], data.qpos[0] + NOISE * random.standard_normal()])
        mujoco.mj_step(model, data, TICK)
    path = folder / "log.csv"
    np.savetxt(path, rows, "%.7f", ",", header="time,coil,position", comments="")
    return path


@pytest.mark.parametrize("named", [True, False])
def test_stops_are_found_where_they_are_and_only_there(tmp_path: Path, named: bool) -> None:
    (tmp_path / "stopped.xml").write_text(MODEL.format(limits=""))
    log = drive(tmp_path, ' limited="true" range="-0.05 0.05"' if named else "")
    answer = rigtwin.diagnose(log, machine=tmp_path / "stopped.xml")
    assert [str(effect.name) for effect in answer.effects] == ["end_stops@axis"] * named
    if named:
        values = answer.effects[0].parameters
        assert values["stop_low"].value == pytest.approx(-0.05, abs=1e-3)
        assert values["stop_high"].value == pytest.approx(0.05, abs=1e-3)
