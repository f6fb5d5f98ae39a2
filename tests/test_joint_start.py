"""Where a machine starts that sensors of velocity alone see, as rate gyros and tachometers do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components import with_parameters
from rigtwin.recording import RecordedTest
from tests.helpers.coupled import ARM, arm, described, integrate, recording
from tests.helpers.reference import swing_dry

PENDULUM = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="fork"><joint name="edge" type="hinge" axis="0 1 0"/>
<geom type="sphere" pos="0 0 -0.4" size="0.0005" mass="2.5"/></body></worldbody>
<actuator><motor name="push" joint="edge"/></actuator>
<sensor><jointvel name="gyro" joint="edge"/></sensor></mujoco>"""
TOML = """
[machine]
name = "fork"
model = "fork.xml"
[components]
fork = { body = "fork" }
edge = { joint = "edge" }
push = { actuator = "push", effects = [] }
gyro = { sensor = "gyro", channel = "rate", effects = ["gain", "offset"] }
[[replays]]
moved_by = "push"
observe = ["gyro"]
"""
PERIOD, SECONDS = 5e-3, 20.0
MASS, LEVER, COULOMB, ZERO = 2.5, 0.4, 0.02, 1.2


def swung(start: tuple[float, float], zero: float, coulomb: float) -> RecordedTest:
    _, rate, _ = swing_dry(MASS, LEVER, coulomb, start, np.arange(0.0, SECONDS, PERIOD))
    rate = rate + zero + 2e-3 * np.random.default_rng(4).standard_normal(rate.size)
    columns = {"/command": {"push": np.zeros(rate.size)}, "/sensor": {"rate": rate}}
    time = np.arange(rate.size) * PERIOD
    return RecordedTest(Path("swing"), "fork", "", PERIOD, time, columns, {})


@pytest.mark.parametrize("start", [(0.3, 0.0), (0.05, -1.2), (-1.0, 0.5)])
def test_a_swing_that_a_gyro_alone_sees_starts_where_it_did(
    tmp_path: Path, start: tuple[float, float]
) -> None:
    machine = described(tmp_path, "fork", PENDULUM, TOML)
    seen = swung(start, 0.0, 0.0)
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 8)
    rate = model.predict(machine.plant)[0]
    assert np.std(rate - seen.column("/sensor", "rate")) < 3e-3
    assert model.move(machine.plant)[:2, 0] == pytest.approx(start, abs=5e-3)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_friction_and_the_zero_of_a_gyro_are_found(tmp_path: Path) -> None:
    machine = described(tmp_path, "fork", PENDULUM, TOML)
    answer = rigtwin.diagnose(swung((0.25, 0.3), ZERO, COULOMB), machine=machine)
    found = {str(each.name): next(iter(each.parameters.values())) for each in answer.effects}
    assert set(found) == {"coulomb@edge", "offset@gyro"}
    assert found["coulomb@edge"].value == pytest.approx(COULOMB, rel=0.03)
    assert found["offset@gyro"].value == pytest.approx(ZERO, abs=1e-2)
    assert answer.verdict == "explained"


def test_an_arm_that_gyros_alone_see_starts_where_it_did(tmp_path: Path) -> None:
    machine = arm(tmp_path, mjcf=ARM.replace("jointpos", "jointvel"))
    torques = np.zeros((2, 400))
    start = (0.3, -0.5), (0.4, 0.2)
    _, rates = integrate(torques, *start)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(rates.shape)
    seen = recording(
        machine,
        {
            "/command": {"drive_1": torques[0], "drive_2": torques[1]},
            "/sensor": {"angle_1": rates[0] + noise[0], "angle_2": rates[1] + noise[1]},
        },
    )
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 4)
    moved = model.move(machine.plant)  # type: ignore[attr-defined]
    assert moved[:2, :, 0] == pytest.approx(np.array(start), abs=2e-2)
    assert np.std(moved[1] - rates) < 5e-3


SLIDE = """<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"
damping="0.5"/><geom type="sphere" size="0.1" mass="2"/></body></worldbody>
<actuator><motor name="push" joint="rail"/></actuator>
<sensor><jointpos name="encoder" joint="rail"/></sensor></mujoco>"""
SLIDE_TOML = """
[machine]
name = "cart"
model = "cart.xml"
[components]
cart = { body = "cart" }
rail = { joint = "rail" }
push = { actuator = "push" }
encoder = { sensor = "encoder", channel = "place", effects = [] }
[[replays]]
moved_by = "push"
observe = ["encoder"]
"""


def pushed_cart() -> RecordedTest:
    """Cart under a held force, m·x'' = F − d·x' solved exactly from tick to tick, with noise."""
    mass, damping = 2.0, 0.5
    time = np.arange(0.0, 8.0, PERIOD)
    force = 2.0 * np.sin(2.3 * time)
    decay = np.exp(-damping * PERIOD / mass)
    place, speed = np.zeros((2, time.size))
    place[0], speed[0] = 0.1, 0.4
    for tick in range(time.size - 1):
        end = force[tick] / damping
        speed[tick + 1] = end + (speed[tick] - end) * decay
        place[tick + 1] = (
            place[tick] + end * PERIOD + (speed[tick] - end) * (1.0 - decay) * mass / damping
        )
    place = place + 1e-4 * np.random.default_rng(6).standard_normal(time.size)
    columns = {"/command": {"push": force}, "/sensor": {"place": place}}
    return RecordedTest(Path("push"), "cart", "", PERIOD, time, columns, {})


@pytest.mark.parametrize(("viscous", "apart"), [(0.5, 2e-5), (0.51, 5e-4)])
def test_a_search_corrects_the_start_to_first_order(
    tmp_path: Path, viscous: float, apart: float
) -> None:
    machine, seen = described(tmp_path, "cart", SLIDE, SLIDE_TOML), pushed_cart()
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 4)
    quick = model.thin(1e-3)
    assert (model.has_linear_starts, quick.has_linear_starts) == (False, True)
    assert quick.halve_steps().has_linear_starts
    plant = with_parameters(machine.plant, "rail", {"viscous": viscous})
    exact, first_order = model.predict(plant)[0], quick.predict(plant)[0]
    assert np.std(exact - first_order) < apart
    if viscous == 0.5:
        assert np.std(first_order - seen.column("/sensor", "place")) < 1.1e-4
    assert quick.effort < 0.3 * model.effort


def test_a_free_swing_keeps_its_fitted_start(tmp_path: Path) -> None:
    machine = described(tmp_path, "fork", PENDULUM, TOML)
    seen = swung((0.3, 0.0), 0.0, 0.0)
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 8)
    assert not model.thin(1e-3).has_linear_starts
