"""Where a machine starts that sensors of velocity alone see, as rate gyros and tachometers do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components import Guide, component_of, with_parameters
from rigtwin.description.machine import Machine
from rigtwin.recording import Recording
from tests.helpers.coupled import ARM, arm, described, integrate, recording
from tests.helpers.described import NOISY
from tests.helpers.described import described as slide
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


def swung(start: tuple[float, float], zero: float, coulomb: float) -> Recording:
    _, rate, _ = swing_dry(MASS, LEVER, coulomb, start, np.arange(0.0, SECONDS, PERIOD))
    rate = rate + zero + 2e-3 * np.random.default_rng(4).standard_normal(rate.size)
    columns = {"/command": {"push": np.zeros(rate.size)}, "/sensor": {"rate": rate}}
    time = np.arange(rate.size) * PERIOD
    return Recording(Path("swing"), "fork", "", PERIOD, time, columns, {})


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


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Machine, Recording]:
    """A slide that a force pushes, whose true start differs from the first noisy samples."""
    folder = tmp_path_factory.mktemp("slide")
    machine = slide(folder, "slide", NOISY)
    return machine, rigtwin.run(machine, "shake", seed=5)


@pytest.mark.parametrize("viscous", [1.0, 1.02])
def test_a_search_corrects_the_start_to_first_order(
    pushed: tuple[Machine, Recording], viscous: float
) -> None:
    machine, seen = pushed
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 4)
    quick = model.thin(1e-3)
    assert quick.has_linear_starts
    assert not model.has_linear_starts
    nominal = component_of(machine.plant, "guide", Guide)
    values = {"viscous": viscous * nominal.viscous, "coulomb": 0.1 * (viscous - 1.0)}
    plant = with_parameters(machine.plant, "guide", values)
    exact, first_order = model.predict(plant)[0], quick.predict(plant)[0]
    as_read = quick.move(plant)  # type: ignore[attr-defined]
    assert as_read.shape == (4, seen.ticks)
    assert np.std(exact - first_order) < 0.02 * np.std(exact)
    assert quick.effort < 0.3 * model.effort


def test_a_free_swing_keeps_its_fitted_start(tmp_path: Path) -> None:
    machine = described(tmp_path, "fork", PENDULUM, TOML)
    seen = swung((0.3, 0.0), 0.0, 0.0)
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 8)
    assert not model.thin(1e-3).has_linear_starts
