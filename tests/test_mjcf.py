"""The user's MJCF with corrected values, and nothing else changed."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.description.mjcf_text import Document
from tests.helpers.described import TOML, described

MODEL = """<!-- a bench, "as it stands" -->
<mujoco model="bench">
  <default><joint damping="6"/></default>
  <worldbody>
    <body name="arm" >
      <joint name='axis' type="slide" axis="1 0 0"
             stiffness="150"/>
      <geom name="block" size="0.05" mass="2"/>   <!-- > steel -->
      <body name="tip" pos="0 0 0.1"><inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 2e-3"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="axis" gear="3 0 0 0 0 0"/></actuator>
  <sensor><jointpos name="encoder" joint="axis"/></sensor>
</mujoco>
"""
ROTOR = '[components.rotor]\njoint = "axis"\ntype = "rotor"\n\n[components.drive]'


@pytest.fixture
def machine(tmp_path):
    described(tmp_path)
    (tmp_path / "bench.xml").write_text(MODEL)
    (tmp_path / "bench.toml").write_text(TOML.replace("[components.drive]", ROTOR))
    return rigtwin.machine(tmp_path / "bench.toml")


def fields(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    found = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    return {name: value.copy() for name, value in found.items() if isinstance(value, np.ndarray)}


def test_polynomials_of_springs_and_dampers_are_read_and_written(tmp_path):
    described(tmp_path)
    polynomials = MODEL.replace('stiffness="150"', 'stiffness="150 0 900" damping="6 2.5"')
    (tmp_path / "bench.xml").write_text(polynomials)
    (tmp_path / "bench.toml").write_text(TOML)
    machine = rigtwin.machine(tmp_path / "bench.toml")
    guide = machine.plant.guide
    assert (guide.stiffness, guide.cubic_stiffness) == (150.0, 900.0)
    assert (guide.viscous, guide.drag) == (6.0, 2.5)
    changes = [Change("guide", "cubic_stiffness", 400.0), Change("guide", "drag", 0.0)]
    assert write_mjcf(tmp_path / "new.xml", machine, changes) == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert (*model.jnt_stiffness, *model.jnt_stiffnesspoly[0]) == (150.0, 0.0, 400.0)
    assert (*np.ravel(model.dof_damping), *model.dof_dampingpoly[0]) == (6.0, 0.0, 0.0)


def test_what_a_guide_cannot_express_of_a_polynomial_is_said(tmp_path):
    described(tmp_path)
    polynomials = MODEL.replace('stiffness="150"', 'stiffness="150 20 900" damping="6 2.5 1"')
    (tmp_path / "bench.xml").write_text(polynomials)
    (tmp_path / "bench.toml").write_text(TOML)
    assert rigtwin.machine(tmp_path / "bench.toml").overlooked == (
        "joint axis: the quadratic part of its stiffness",
        "joint axis: the cubic damping",
    )
    machine = rigtwin.machine(tmp_path / "bench.toml")
    change = Change("guide", "stiffness", 200.0)
    assert write_mjcf(tmp_path / "new.xml", machine, [change]) == ("guide.stiffness = 200",)


def test_only_what_is_corrected_changes(machine, tmp_path):
    path = tmp_path / "new.xml"
    changes = [
        Change("guide", "coulomb", 12.5),
        Change("guide", "viscous", 7.25),
        Change("guide", "backlash", 0.002),
        Change("rotor", "inertia", 0.3),
        Change("drive", "gain", 1.1),
    ]
    assert write_mjcf(path, machine, changes) == ("guide.backlash = 0.002",)
    before, after = (fields(mujoco.MjModel.from_xml_path(str(p))) for p in (machine.model, path))
    assert after["dof_frictionloss"][0] == 12.5
    assert np.ravel(after["dof_damping"])[0] == 7.25
    assert after["dof_armature"][0] == 0.3
    assert after["actuator_gear"][0, 0] == pytest.approx(3.3)
    changed = {name for name in before if not np.array_equal(before[name], after[name])}
    follows = {"dof_M0", "dof_invweight0", "body_invweight0", "actuator_acc0"}
    mine = {"dof_frictionloss", "dof_damping", "dof_armature", "actuator_gear"}
    assert mine <= changed <= mine | follows
    # To the letter: comments, quotes and blanks too.
    old, new = machine.model.read_text(), path.read_text()
    undone = new.replace(' frictionloss="12.5" damping="7.25" armature="0.3"', "")
    assert undone.replace('gear="3.3"', 'gear="3 0 0 0 0 0"') == old


def test_a_limit_of_the_force_stays_where_it_is_when_the_gear_changes(machine, tmp_path):
    text = MODEL.replace('gear="3 0 0 0 0 0"', 'gear="3 0 0 0 0 0" forcerange="-5 5"')
    machine.model.write_text(text)
    machine = rigtwin.machine(tmp_path / "bench.toml")
    assert machine.plant.drive.force_limit == 15.0
    path = tmp_path / "new.xml"
    assert write_mjcf(path, machine, [Change("drive", "gain", 1.25)]) == ()
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.actuator_gear[0, 0] * model.actuator_forcerange[0, 1] == pytest.approx(15.0)
    both = [Change("drive", "gain", 1.25), Change("drive", "force_limit", 7.5)]
    assert write_mjcf(path, machine, both) == ()
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.actuator_gear[0, 0] * model.actuator_forcerange[0, 1] == pytest.approx(7.5)


def test_a_mass_is_that_of_all_that_moves(machine, tmp_path):
    path = tmp_path / "new.xml"
    nominal = machine.plant.mass.mass
    assert nominal == pytest.approx(2.5)
    assert write_mjcf(path, machine, [Change("mass", "mass", 3.0)]) == ()
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.body_mass[1:].tolist() == pytest.approx([2.4, 0.6])
    assert model.body_inertia[2].tolist() == pytest.approx([1.2e-3, 1.2e-3, 2.4e-3])


def test_a_mass_that_the_file_does_not_tell_is_said(machine, tmp_path):
    machine.model.write_text(MODEL.replace(' mass="2"', ""))
    left = write_mjcf(tmp_path / "new.xml", machine, [Change("mass", "mass", 3.0)])
    assert left == ("mass.mass = 3",)


def test_what_stands_in_another_file_is_said(machine, tmp_path):
    machine.model.write_text(MODEL.replace("name='axis'", "name='other'"))
    with pytest.raises(rigtwin.RigtwinError, match="has no joint 'axis' itself"):
        write_mjcf(tmp_path / "new.xml", machine, [Change("guide", "coulomb", 1.0)])


def test_tags_are_found_where_they_stand(machine):
    document = Document(machine.model)
    assert document.find("joint", "axis").attributes["stiffness"] == "150"
    assert document.find("body", "tip").name == "body"
    assert document.text() == machine.model.read_bytes()


def test_a_diagnosis_writes_the_model(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ["run", "positioning", "--machine", "emps", "--set", "timing.duration=6"]
    assert main([*run, "--effect", "coulomb@guide=20", "--out", "worn.mcap"]) == 0
    assert main(["diagnose", "worn.mcap", "--save-mjcf", "worn.xml"]) == 0
    assert "corrected MJCF in worn.xml" in capsys.readouterr().out
    model = mujoco.MjModel.from_xml_path("worn.xml")
    assert model.dof_frictionloss[0] == pytest.approx(20.0, rel=0.03)
