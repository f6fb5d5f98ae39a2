"""A model is enough: described as it is, run with a test of its own, diagnosed by its name."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import rigtwin
from tests.test_links import LOAD, TORQUES, model

SHORT = {"timing": {"duration": 4.0}}


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(model())
    return path


@pytest.fixture
def motors(tmp_path: Path) -> Path:
    path = tmp_path / "motors.xml"
    text = model(sensors=TORQUES).replace('model="arm"', 'model="motors"')
    start, end = text.index("<actuator>"), text.index("</actuator>")
    moved = '<actuator><motor name="m1" joint="shoulder"/><motor name="m2" joint="elbow"/>'
    path.write_text(text[:start] + moved + text[end:])
    return path


def test_position_actuators_are_servos_and_their_positions_are_predicted(arm: Path):
    machine = rigtwin.machine(arm)
    assert machine.name == "arm"
    assert machine.replays[0].free == ("shoulder", "elbow")
    assert [row.name for row in machine.rows] == ["q1", "q2"]


def test_other_joints_move_as_demanded_and_their_forces_are_predicted(motors: Path):
    machine = rigtwin.machine(motors)
    assert machine.replays[0].free == ()
    assert [row.name for row in machine.rows] == ["tau1", "tau2"]


def test_every_machine_of_joints_has_a_test_within_its_ranges(tmp_path: Path):
    text = model().replace('axis="0 -1 0"', 'axis="0 -1 0" range="-1 0.5"')
    (tmp_path / "arm.xml").write_text(text)
    recording = rigtwin.run(tmp_path / "arm.xml", "excite", seed=3, settings=SHORT)
    for name in ("m1", "m2"):
        command = recording[f"/command.{name}"]
        assert np.ptp(command) > 0.15
        assert -1.0 < command.min() < command.max() < 0.5
    again = rigtwin.run(tmp_path / "arm.xml", "excite", seed=3, settings=SHORT)
    assert np.array_equal(recording["/sensor.q1"], again["/sensor.q1"])
    assert "excite" in rigtwin.experiments("tx40")


@pytest.mark.slow
def test_a_hidden_friction_is_found_by_the_model_alone(motors: Path, tmp_path: Path):
    path = tmp_path / "log.mcap"
    rigtwin.run(motors, "excite", effects={"coulomb@elbow": 0.4}, settings=SHORT, path=path)
    (found,) = rigtwin.diagnose(path, machine=motors).effects
    assert str(found.name) == "coulomb@elbow"
    assert found.parameters["coulomb"].value == pytest.approx(0.4, rel=0.02)


def test_a_model_without_joints_is_refused(tmp_path: Path):
    (tmp_path / "stone.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    with pytest.raises(rigtwin.RigtwinError, match="no hinge or slide with a name"):
        rigtwin.machine(tmp_path / "stone.xml")


def test_a_robot_of_the_menagerie_is_a_model_with_a_name(arm: Path, monkeypatch):
    menagerie = pytest.importorskip("mujoco_menagerie")
    with pytest.raises(rigtwin.RigtwinError, match=r"menagerie:ur5: Unknown robot 'ur5'"):
        rigtwin.machine("menagerie:ur5")
    # Downloads need a network: the robot's files are taken from here instead.
    robot = SimpleNamespace(default_model="ur5e", xml=lambda entry: arm)
    monkeypatch.setattr(menagerie, "get", {"universal_robots_ur5e": robot}.get)
    assert rigtwin.machine("menagerie:universal_robots_ur5e").name == "arm"
    assert rigtwin.describe("menagerie:universal_robots_ur5e", log_of(arm)).machine.name == "arm"


def log_of(arm: Path) -> Path:
    time = np.arange(400) * 0.01
    waves = [0.3 * np.sin(2 * np.pi * rate * time) for rate in (0.7, 0.9, 0.7, 0.9)]
    path = arm.parent / "log.csv"
    rows = np.column_stack([time, *waves])
    np.savetxt(path, rows, delimiter=",", header="time,m1_cmd,m2_cmd,q1,q2", comments="")
    return path


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(rigtwin.RigtwinError, match=r"pip install 'rigtwin\[menagerie\]'"):
        rigtwin.machine("menagerie:universal_robots_ur5e")


@pytest.mark.slow
def test_a_hidden_payload_is_found_on_servos(arm: Path, tmp_path: Path):
    heavy = tmp_path / "heavy.xml"
    heavy.write_text(model(LOAD))
    recording = rigtwin.run(heavy, "excite", settings=SHORT)
    (found,) = rigtwin.diagnose(recording, machine=arm).effects
    assert str(found.name) == "payload@fore"
    assert found.parameters["payload"].value == pytest.approx(0.5, rel=0.03)
