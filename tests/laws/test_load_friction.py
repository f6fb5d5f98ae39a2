"""Load friction of the same guide in every model: the load that each of them counts.

Where the motion is given, the load is what reaches the guide from the body and its own spring.
Where the motion follows from a force, it is the force of the actuator.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigtwin.components import Guide, Servo
from rigtwin.components.guide_step import guide_step_of
from rigtwin.description.document import load
from rigtwin.models.joint_inverse import resist_at_once
from rigtwin.recording import RecordedTest
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
def test_a_joint_moved_as_measured_counts_the_transmitted_load():
    """Steadily accelerated at a: F = N + F_c + μ |N| with N = m a + G."""
    force = force_to_move(GUIDE, 0.5 * 4.0 * TIME**2, mass=MASS, load=WEIGHT)
    carried = MASS * 4.0 + WEIGHT
    np.testing.assert_allclose(force[5:-5], carried + COULOMB + MU * carried, rtol=1e-6)


@law_of("load_friction", Guide)
def test_joints_moved_together_count_the_bodies_load_and_the_guides_spring():
    """F = N + F_c + μ |N| with N = L + k x, L what the bodies take."""
    guide = GUIDE._replace(stiffness=50.0)
    position = 0.2 * TIME
    motion = np.stack([position, np.full(500, 0.2), np.zeros(500)])
    force = np.full(500, -30.0)
    resist_at_once(guide_step_of(guide, 1.0, 0.0, PERIOD), motion, force)
    carried = -30.0 + 50.0 * position
    np.testing.assert_allclose(force, carried + COULOMB + MU * np.abs(carried))


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
    recording = RecordedTest(Path("two"), "two", "", PERIOD, TIME, columns, {})
    plant = machine.plant._replace(two=GUIDE)
    model = machine.physics.model(
        machine, recording.inputs, machine.configuration._replace(plant=plant), 2
    )
    found = model.predict(plant)
    acceleration = (40.0 - 2.0 * 6.0 - COULOMB - MU * 40.0) / 2.0
    np.testing.assert_allclose(found[1], 0.5 * acceleration * TIME**2, atol=5e-3 * found[1, -1])
    np.testing.assert_allclose(found[0], 0.0, atol=1e-9)


GAIN, DAMPING, SPEED = 400.0, 30.0, 0.2
DRAGGED = (COULOMB / (1.0 - MU) + DAMPING * SPEED) / GAIN + 0.5 * PERIOD * SPEED
"""Distance by which a joint lags behind its servo's command at a steady speed v, m, from
F = k e − d v and F = F_c + μ |F|. A command that is held is late by half a tick on average."""


@law_of("load_friction", Guide)
def test_a_pushed_joint_counts_the_whole_force_of_its_servo():
    servo = Servo(position_gain=GAIN, damping_gain=DAMPING)
    command = SPEED * PERIOD * np.arange(3000)
    position = motion_under(GUIDE, command, MASS, servo, start=(0.0, SPEED))[0]
    assert command[-1] - position[-1] == pytest.approx(DRAGGED, rel=1e-3)


@law_of("load_friction", Guide)
@pytest.mark.skipif(INTERPRETED, reason="coupled joints call MuJoCo from compiled code")
def test_coupled_joints_count_the_whole_force_of_their_servo(tmp_path: Path):
    actuator = f'<position name="push" joint="one" kp="{GAIN}" kv="{DAMPING}"/>'
    model = MJCF.replace('<motor name="push" joint="two"/>', actuator)
    (tmp_path / "two.xml").write_text(model.replace('gravity="0 0 -6"', 'gravity="0 0 0"'))
    (tmp_path / "two.toml").write_text(TOML.replace('"push",', '"push", type = "servo",'))
    machine = load(tmp_path / "two.toml")
    still, command = np.zeros(3000), SPEED * PERIOD * np.arange(3000)
    time = PERIOD * np.arange(3000)
    columns = {"/command": {"push": command}, "/sensor": {"x_one": command, "x_two": still}}
    recording = RecordedTest(Path("two"), "two", "", PERIOD, time, columns, {})
    plant = machine.plant._replace(one=GUIDE)
    model = machine.physics.model(
        machine, recording.inputs, machine.configuration._replace(plant=plant), 2
    )
    lag = command[-1] - model.predict(plant)[0, -1]
    assert lag == pytest.approx(DRAGGED, rel=1e-3)


def test_both_loads_differ_by_the_friction_itself():
    """The force that moves a weight N steadily is N + μ N; pushed by it, the joint is slowed down
    by μ (N + μ N) − μ N = μ² N."""
    guide = Guide(load_coefficient=MU)
    force = force_to_move(guide, 0.2 * TIME, load=WEIGHT)[250]
    assert force == pytest.approx(WEIGHT * (1.0 + MU))
    speed = motion_under(guide, np.full(100, force), MASS, load=WEIGHT, start=(0.0, 0.2))[1]
    slowed = np.gradient(speed, PERIOD)[5:-5]
    np.testing.assert_allclose(slowed, -(MU**2) * WEIGHT / MASS, rtol=1e-6)
