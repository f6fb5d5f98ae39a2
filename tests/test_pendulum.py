"""A pendulum that is pushed over its top, against the equation of motion written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components import Effect
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.balance import balance_forces
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from tests.helpers.coupled import described
from tests.helpers.reference import swing_dry

MJCF = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="arm"><joint name="shaft" type="hinge" axis="0 1 0"/>
<geom type="sphere" pos="0 0 -0.4" size="0.0005" mass="2.5"/></body></worldbody>
<actuator><motor name="drive" joint="shaft"/></actuator>
<sensor><jointpos name="encoder" joint="shaft"/></sensor></mujoco>"""
TOML = """
[machine]
name = "arm"
model = "arm.xml"
[components]
arm = { body = "arm", effects = [] }
shaft = { joint = "shaft" }
drive = { actuator = "drive", command = "torque" }
encoder = { sensor = "encoder", channel = "position" }
[[replays]]
moved_by = "drive"
observe = ["encoder"]
"""
PERIOD = 5e-3
MASS, LEVER, COULOMB, VISCOUS = 2.5, 0.4, 0.35, 0.12


def pushed(seconds: float = 10.0) -> RecordedTest:
    """Swung up by a torque that follows its speed, so that it goes round several times."""
    time = np.arange(0.0, seconds, PERIOD)
    swung = swing_dry(MASS, LEVER, COULOMB, (0.0, 0.1), time, VISCOUS, push)
    angle = swung[0] + 1e-4 * np.random.default_rng(2).standard_normal(time.size)
    columns = {"/command": {"torque": swung[2]}, "/sensor": {"position": angle}}
    return RecordedTest(Path("pushed"), "arm", "", PERIOD, time, columns, {})


def push(time: float, angle: float, rate: float) -> float:
    """Nm: pumped at first, then let go."""
    return 3.0 * float(np.sign(rate)) + 0.5 * np.sin(3.0 * time) if time < 6.0 else 0.0


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return described(tmp_path, "arm", MJCF, TOML)


def test_it_weighs_the_same_after_a_turn(machine: Machine) -> None:
    seen = pushed()
    angle = seen.column("/sensor", "position")
    assert np.ptp(angle) > 4.0 * np.pi
    plant = machine.plant._replace(  # type: ignore[attr-defined]
        shaft=machine.plant.shaft._replace(coulomb=COULOMB, viscous=VISCOUS)  # type: ignore[attr-defined]
    )
    beginning = int(4.0 / PERIOD)
    model = machine.physics.model(machine, seen.inputs, machine.configuration_of(seen), 16)
    assert np.std((model.predict(plant)[0] - angle)[:beginning]) < 2e-3


def test_forces_tell_what_the_swing_of_a_poor_twin_does_not(machine: Machine) -> None:
    seen = pushed()
    evidence = Evidence(machine, [seen], [machine.configuration_of(seen)])
    kinds = {"coulomb@shaft": COULOMB, "viscous@shaft": VISCOUS, "stiffness@shaft": 0.0}
    effects: list[Effect] = [each for each in machine.effects() if str(each.name) in kinds]
    found = balance_forces(Fitter(evidence), effects)
    assert found is not None
    for effect, values in zip(effects, found, strict=True):
        assert values[0] == pytest.approx(kinds[str(effect.name)], rel=0.1, abs=0.02)


@pytest.mark.slow
def test_friction_is_found_where_the_nominal_twin_goes_round_and_round(machine: Machine) -> None:
    answer = rigtwin.diagnose(pushed(), machine=machine)
    found = {str(each.name): next(iter(each.parameters.values())) for each in answer.effects}
    assert set(found) == {"coulomb@shaft", "viscous@shaft"}
    assert found["coulomb@shaft"].value == pytest.approx(COULOMB, rel=0.03)
    assert found["viscous@shaft"].value == pytest.approx(VISCOUS, rel=0.03)


def test_what_is_prescribed_misses_no_force() -> None:
    machine = rigtwin.machine("damper-bench")
    time = np.arange(1000) * 1e-3
    wave = 0.01 * np.sin(6.0 * time)
    columns: dict[str, dict[str, Array]] = {"/sensor": {"displacement": wave, "force": wave}}
    seen = RecordedTest(Path("bench"), machine.name, "", 1e-3, time, columns, {})
    assert (
        machine.physics.model(
            machine, seen.inputs, machine.configuration_of(seen), 1
        ).missing_force(machine.plant)
        is None
    )
