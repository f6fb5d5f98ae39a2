"""End stops that nobody described: found in the motion of MuJoCo's own joint limits."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.errors import RigtwinError

MODEL = """<mujoco model="stopped"><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="carriage"><joint name="axis" type="slide" axis="1 0 0" damping="20"{limits}/>
<inertial pos="0 0 0" mass="1.5" diaginertia="1e-3 1e-3 1e-3"/></body></worldbody>
<actuator><motor name="coil" joint="axis"/></actuator></mujoco>"""
TICK, SECONDS, NOISE = 5, 6.0, 1e-5


def drive(model: mujoco.MjModel) -> np.ndarray:
    """Return time, force and position of a carriage at 200 Hz, shape (rows, 3)."""
    data, random = mujoco.MjData(model), np.random.default_rng(4)
    rows = []
    for tick in range(round(SECONDS / (TICK * model.opt.timestep))):
        time = tick * TICK * model.opt.timestep
        data.ctrl[0] = (
            2.4 * np.sin(4.4 * time) + 2.4 * np.sin(1.9 * time) + 2.0 * np.sin(9.0 * time)
        )
        rows.append([time, data.ctrl[0], data.qpos[0] + NOISE * random.standard_normal()])
        mujoco.mj_step(model, data, TICK)
    return np.array(rows)


@pytest.mark.parametrize("named", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_stops_are_found_where_they_are_and_only_there(tmp_path: Path, named: bool) -> None:
    (tmp_path / "stopped.xml").write_text(MODEL.format(limits=""))
    limits = ' limited="true" range="-0.05 0.05"' if named else ""
    rows = drive(mujoco.MjModel.from_xml_string(MODEL.format(limits=limits)))
    log = tmp_path / "log.csv"
    np.savetxt(log, rows, "%.7f", ",", header="time,coil,position", comments="")
    answer = rigtwin.diagnose(log, machine=tmp_path / "stopped.xml")
    assert [str(effect.name) for effect in answer.effects] == ["end_stops@axis"] * named
    if named:
        values = answer.effects[0].parameters
        assert values["stop_low"].value == pytest.approx(-0.05, abs=1e-3)
        assert values["stop_high"].value == pytest.approx(0.05, abs=1e-3)
        # The corrected model stops where the machine does.
        assert not answer.save_mjcf(tmp_path / "corrected.xml")
        corrected = drive(mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml")))
        error = corrected[:, 2] - rows[:, 2]
        assert np.std(error) < 0.03 * np.std(rows[:, 2])


@pytest.mark.parametrize(("compiler", "unit"), [("", 57.295779513), ('angle="radian"', 1.0)])
def test_a_written_limit_is_a_spring_and_a_damper(
    tmp_path: Path, compiler: str, unit: float
) -> None:
    hinge = f"""<mujoco><compiler {compiler}/><option gravity="0 0 0"/><worldbody><body>
<joint name="axis" axis="0 1 0" range="{-2 * unit} {2 * unit}"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.01 0.01"/></body></worldbody><sensor>
<jointpos name="angle" joint="axis"/><jointactuatorfrc name="torque" joint="axis"/>
</sensor></mujoco>"""
    (tmp_path / "hinge.xml").write_text(hinge)
    (tmp_path / "hinge.toml").write_text(
        """[machine]
name = "hinge"
model = "hinge.xml"
[components.axis]
joint = "axis"
[components.angle]
sensor = "angle"
[components.torque]
sensor = "torque"
[[replays]]
moved_by = "angle"
observe = ["torque"]
"""
    )
    values = {"stop_stiffness": 400.0, "stop_damping": 3.0, "stop_low": -0.5, "stop_high": 0.6}
    changes = [Change("axis", name, value) for name, value in values.items()]
    assert write_mjcf(tmp_path / "out.xml", rigtwin.machine(tmp_path / "hinge.toml"), changes) == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    data = mujoco.MjData(model)
    assert model.jnt_range[0] == pytest.approx((-0.5, 0.6), rel=1e-6)
    data.qpos[0], data.qvel[0] = 0.62, 0.5
    mujoco.mj_forward(model, data)
    assert data.qfrc_constraint[0] == pytest.approx(-400.0 * 0.02 - 3.0 * 0.5, rel=1e-3)


def test_stops_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(
        RigtwinError, match=r"rail\.stop_low 0\.1: expected less than stop_high -0\.1"
    ):
        rigtwin.run(
            "cart-pole", "pushes", effects=["end_stops@rail=5000,stop_low=0.1,stop_high=-0.1"]
        )
