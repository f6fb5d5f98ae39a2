"""Load friction of the same guide in every model is in proportion to the drive's force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigtwin.components import Guide
from rigtwin.components.guide_step import guide_step_of
from rigtwin.description.document import load
from rigtwin.models.joint_inverse import resist_at_once
from rigtwin.recording import Recording
from tests.laws.joints import INTERPRETED, PERIOD, force_to_move, motion_under
from tests.laws.written import law_of

MU, COULOMB, MASS, WEIGHT = 0.1, 3.0, 2.0, 12.0
GUIDE = Guide(COULOMB, load_coefficient=MU)
TIME = PERIOD * np.arange(500)
MJCF = """<mujoco model="two"><option gravity="0 0 -6"/><worldbody>
<body name="a"><joint name="one" type="slide" axis="1 0 0"/><geom size="0.1" mass="5"/></body>
<body name="b"><joint name="two" type="slide" axis="0 0 1"/><geom size="0.1" mass="2"/></body>
</worldbody><actuator><motor name="push" joint="two"/></actuator>
<sensor><jointpos name="x_one" joint="one"/><jointpos name="x_two" joint="two"/></sensor>
</mujoco>"""
TOML = """
[machine]
name = "two"
model = "two.xml"
[components]
one = { joint = "one" }
two = { joint = "two" }
push = { actuator = "push", effects = [] }
x_one = { sensor = "x_one", effects = [] }
x_two = { sensor = "x_two", effects = [] }
[[replays]]
free = ["one", "two"]
moved_by = ["push"]
observe = ["x_one", "x_two"]
"""


@law_of("load_friction", Guide)
def test_a_joint_moved_as_measured_counts_the_force_that_moves_it():
    """Steadily accelerated at a: F = m a + G + F_c + μ |F|."""
    force = force_to_move(GUIDE, 0.5 * 4.0 * TIME**2, mass=MASS, load=WEIGHT)
    carried = MASS * 4.0 + WEIGHT
    np.testing.assert_allclose(force[5:-5], carried + COULOMB + MU * force[5:-5], rtol=1e-6)


@law_of("load_friction", Guide)
@pytest.mark.parametrize("speed", [0.2, -0.2])
@pytest.mark.parametrize("taken", [-30.0, 30.0])
def test_joints_moved_together_count_the_force_along_the_guide(speed: float, taken: float):
    """F = L + k x + (F_c + μ |F|) sgn v, L what the bodies take, lifted or let down."""
    guide = GUIDE._replace(stiffness=50.0)
    position = speed * TIME
    motion = np.stack([position, np.full(500, speed), np.zeros(500)])
    force = np.full(500, taken)
    resist_at_once(guide_step_of(guide, 1.0, 0.0, PERIOD), motion, force)
    friction = np.sign(speed) * (COULOMB + MU * np.abs(force))
    np.testing.assert_allclose(force, taken + 50.0 * position + friction)


@law_of("load_friction", Guide)
def test_a_pushed_joint_counts_its_actuators_force():
    """m a = F − G − F_c − μ |F|."""
    speed = motion_under(GUIDE, np.full(500, 40.0), MASS, load=WEIGHT)[1]
    expected = (40.0 - WEIGHT - COULOMB - MU * 40.0) / MASS
    np.testing.assert_allclose(np.gradient(speed, PERIOD)[5:-5], expected, rtol=1e-6)


@law_of("load_friction", Guide)
@pytest.mark.skipif(INTERPRETED, reason="coupled joints call MuJoCo from compiled code")
def test_coupled_joints_count_their_actuators_force(tmp_path: Path):
    """The same equation as that of a pushed joint alone: m a = F − m g − F_c − μ |F|."""
    (tmp_path / "two.xml").write_text(MJCF)
    (tmp_path / "two.toml").write_text(TOML)
    machine = load(tmp_path / "two.toml")
    still, push = np.zeros(500), np.full(500, 40.0)
    columns = {"/command": {"push": push}, "/sensor": {"x_one": still, "x_two": still}}
    recording = Recording(Path("two"), "two", "", PERIOD, TIME, columns, {})
    plant = machine.plant._replace(two=GUIDE)
    model = machine.physics.model(
        machine, recording.inputs, machine.configuration._replace(plant=plant), 2
    )
    found = model.predict(plant)
    acceleration = (40.0 - 2.0 * 6.0 - COULOMB - MU * 40.0) / 2.0
    np.testing.assert_allclose(found[1], 0.5 * acceleration * TIME**2, atol=5e-3 * found[1, -1])
    np.testing.assert_allclose(found[0], 0.0, atol=1e-9)


def test_the_force_that_moves_a_weight_steadily_keeps_it_moving_steadily():
    """F = N + μ F, and pushed by F the joint keeps its speed: both models mean the same load."""
    guide = Guide(load_coefficient=MU)
    force = force_to_move(guide, 0.2 * TIME, load=WEIGHT)[250]
    assert force == pytest.approx(WEIGHT / (1.0 - MU))
    speed = motion_under(guide, np.full(100, force), MASS, load=WEIGHT, start=(0.0, 0.2))[1]
    np.testing.assert_allclose(np.diff(speed[5:]), 0.0, atol=1e-9)
    np.testing.assert_allclose(speed[5:], 0.2, rtol=0.01)
