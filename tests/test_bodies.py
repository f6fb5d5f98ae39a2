"""Bodies of joints that act on each other, other than told: against equations written by hand and
MuJoCo's own."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from benchmarks import arms
from rigtwin.components import Base, Body
from rigtwin.components.body import (
    about_frame,
    list_parameters,
    turn_gravity,
)
from rigtwin.description.document import examine
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.models.multibody import Multibody
from tests.helpers import arm
from tests.helpers.arm import MJCF, TOML, described_arm, motion, recording, torques
from tests.helpers.bodies import arrange_pseudo_inertia

INSIDE = slice(400, -400)
BODIES = """
[components.lower]
body = "lower"
type = "body"
effects = ["mass", "payload", "lever_z", "inertia"]

[components.floor]
body = "upper"
type = "base"
effects = ["tilt_y"]
"""


@pytest.fixture(scope="module")
def moved():
    return motion(8.0)


def predict(machine: Machine, moved: tuple[np.ndarray, ...], **changes: object) -> np.ndarray:
    data = recording(moved[0], torques(*moved), (0.0, 0.0))
    configuration = machine.configuration_of(data)
    plant = machine.plant._replace(**changes)
    return machine.physics.model(machine, data.inputs, configuration, 1).predict(plant)


def by_mujoco(mjcf: str, moved: tuple[np.ndarray, ...]) -> np.ndarray:
    """Forces of the same motion on another model, shape (2, ticks)."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    found = np.empty_like(moved[0])
    for tick in range(found.shape[1]):
        data.qpos[:], data.qvel[:], data.qacc[:] = (each[:, tick] for each in moved)
        mujoco.mj_inverse(model, data)
        found[:, tick] = data.qfrc_inverse
    return found


CHANGES = [
    (
        {"mass": 1.5},
        'mass="1.2" pos="0 0 -0.15" diaginertia="0.012 0.012 0.001"',
        'mass="1.5" pos="0 0 -0.15" diaginertia="0.015 0.015 0.00125"',
    ),
    ({"centre_z": -0.2, "centre_x": 0.03}, 'pos="0 0 -0.15"', 'pos="0.03 0 -0.2"'),
    ({"inertia": 2.0}, '"0.012 0.012 0.001"', '"0.024 0.024 0.002"'),
    (
        {"payload": 0.4, "payload_x": 0.05, "payload_z": -0.3},
        '<inertial mass="1.2"',
        '<body name="load" pos="0.05 0 -0.3"><inertial mass="0.4" pos="0 0 0" '
        'diaginertia="1e-9 1e-9 1e-9"/></body><inertial mass="1.2"',
    ),
]


@pytest.mark.parametrize(("values", "written", "instead"), CHANGES)
def test_a_body_that_is_other_takes_what_a_changed_mjcf_does(
    tmp_path, moved, values, written, instead
):
    machine = described_arm(tmp_path, TOML + BODIES)
    body = machine.plant.lower
    assert isinstance(body, Body)
    found = predict(machine, moved, lower=body._replace(**values))
    assert written in MJCF
    expected = by_mujoco(MJCF.replace(written, instead), moved)
    usual = by_mujoco(MJCF, moved)
    size = np.sqrt(np.mean((expected - usual) ** 2))
    assert np.sqrt(np.mean((found - expected)[:, INSIDE] ** 2)) < 0.02 * size


def test_a_payload_takes_what_lagrange_says(tmp_path, moved, monkeypatch):
    mass, place = 0.5, 0.25
    total = arm.MASSES[1] + mass
    centre = (arm.MASSES[1] * arm.CENTRES[1] + mass * place) / total
    inertia = arm.INERTIAS[1] + arm.MASSES[1] * (centre - arm.CENTRES[1]) ** 2
    inertia += mass * (place - centre) ** 2
    machine = described_arm(tmp_path, TOML + BODIES)
    loaded = machine.plant.lower._replace(payload=mass, payload_z=-place)
    found = predict(machine, moved, lower=loaded)
    usual = torques(*moved)
    monkeypatch.setattr(arm, "MASSES", (arm.MASSES[0], total))
    monkeypatch.setattr(arm, "CENTRES", (arm.CENTRES[0], centre))
    monkeypatch.setattr(arm, "INERTIAS", (arm.INERTIAS[0], inertia))
    expected = torques(*moved)
    size = np.sqrt(np.mean((expected - usual) ** 2))
    assert np.sqrt(np.mean((found - expected)[:, INSIDE] ** 2)) < 0.02 * size


def test_a_base_that_is_not_level_turns_gravity(tmp_path, moved):
    machine = described_arm(tmp_path, TOML + BODIES)
    found = predict(machine, moved, floor=Base(tilt_y=0.1))
    # About the joints' own axis, −y, it is as if the shoulder were turned the other way.
    turned = (moved[0] + np.array([[-0.1], [0.0]]), moved[1], moved[2])
    expected, usual = by_mujoco(MJCF, turned), by_mujoco(MJCF, moved)
    size = np.sqrt(np.mean((expected - usual) ** 2))
    assert np.sqrt(np.mean((found - expected)[:, INSIDE] ** 2)) < 0.03 * size


def test_gravity_keeps_its_size_however_a_base_is_turned():
    gravity = np.array([0.3, 0.0, -9.81])
    turned = turn_gravity(Base(0.2, -0.3, 0.4), gravity)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(gravity))
    assert turn_gravity(Base(), gravity) == pytest.approx(gravity)
    assert turn_gravity(Base(tilt_x=0.1), gravity)[1] == pytest.approx(-9.81 * np.sin(0.1))


@pytest.mark.parametrize("seed", range(3))
def test_every_body_within_its_bounds_can_be_made(seed):
    random = np.random.default_rng(seed)
    principal = np.sort(random.uniform(0.01, 1.0, 3))
    principal[2] = min(principal[2], 0.95 * (principal[0] + principal[1]))
    nominal = (2.0, np.diag(principal))
    body = Body(
        *random.uniform(0.1, 3.0, 1),
        *random.uniform(-1.0, 1.0, 3),
        inertia=float(random.uniform(0.01, 10.0)),
        payload=float(random.uniform(0.0, 4.0)),
        payload_x=float(random.uniform(-2.0, 2.0)),
    )
    matrix = arrange_pseudo_inertia(list_parameters(body, *nominal))
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    point = about_frame(1.0, np.array([0.0, 0.0, 1.0]), np.zeros((3, 3)))
    assert point == pytest.approx([1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("size", [0.0, 1e-15])
def test_a_body_of_next_to_no_mass_can_be_compiled(tmp_path, size):
    described_arm(tmp_path)
    bodies = Multibody(tmp_path / "arm.xml", ["shoulder", "elbow"], [], [])
    parameters = size * np.array([1.0, 0.0, 0.0, 0.1, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    mass, _, inertia = bodies.change({"lower": parameters}, None).list_nominal("lower")
    assert 0.0 < mass < 1e-9
    assert np.all(np.linalg.eigvalsh(inertia) > 0.0)


def test_a_payload_heavier_than_where_a_search_starts_is_weighed(tmp_path):
    machine, data = arms.describe(6, tmp_path), arms.record(6, 7.0)
    evidence = Evidence(machine, [data], [machine.configuration_of(data)])
    fitter = Fitter(evidence.halve_steps())
    effect = next(each for each in machine.effects() if each.name == "payload@tool")
    found = fitter.fit_one(fitter.screen(effect))
    ((mass, *place),) = found.values
    assert mass == pytest.approx(arms.PAYLOAD, rel=0.02)
    assert place == pytest.approx(arms.PLACE, abs=2e-3)


@pytest.mark.slow
def test_a_payload_is_found_and_weighed(tmp_path, moved):
    toml = TOML.replace('model = "arm.xml"', 'model = "arm.xml"\nnominal = "known"')
    machine = described_arm(tmp_path, toml + BODIES)
    loaded = machine.plant.lower._replace(payload=0.3, payload_z=-0.28)
    data = recording(moved[0], predict(machine, moved, lower=loaded), (1e-5, 0.02))
    found = diagnose(machine, [data])
    (named,) = found.effects
    assert str(named.name) == "payload@lower"
    assert named.parameters["payload"].value == pytest.approx(0.3, rel=0.03)


def test_a_body_alone_is_no_mass_of_a_joint(tmp_path):
    (tmp_path / "arm.xml").write_text(MJCF)
    (tmp_path / "arm.toml").write_text(TOML + '[components.lower]\nbody = "lower"\n')
    _, mistakes = examine(tmp_path / "arm.toml")
    assert any("expected 'body'" in mistake for mistake in mistakes)
