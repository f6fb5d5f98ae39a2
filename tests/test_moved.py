"""Joints that act on each other, moved as measured: against equations written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.document import examine
from rigtwin.description.machine import Structure
from rigtwin.description.parts import parts
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.errors import RigtwinError
from rigtwin.models.choose import model_of
from rigtwin.models.moved import MovedModel
from tests.helpers.arm import (
    COUPLED,
    TOML,
    described_arm,
    motion,
    recording,
    torques,
)

INSIDE = slice(400, -400)
"""Ticks away from both ends, where smoothing and filters have nothing to continue."""


def rms(signal: np.ndarray) -> float:
    return float(np.sqrt(np.mean(signal**2)))


@pytest.fixture(scope="module")
def moved():
    return motion(8.0)


@pytest.mark.parametrize("toml", [TOML, TOML + COUPLED], ids=["alone", "coupled"])
def test_predicted_torques_are_those_of_lagrange(tmp_path, moved, toml):
    machine = described_arm(tmp_path, toml)
    assert machine.structure is Structure.MOVED
    true = torques(*moved)
    data = recording(moved[0], true, (0.0, 0.0))
    configuration = machine.configuration_of(data)
    found = model_of(machine, data, configuration, 1).predict(configuration.plant)
    assert rms((found - true)[:, INSIDE]) < 2e-3 * rms(true)


CHANGES = [
    ("shoulder", {"viscous": 0.7}, (1.0, 0.0), lambda v: 0.7 * v[0]),
    ("elbow", {"viscous": 0.9}, (0.0, 1.0), lambda v: 0.8 * v[1]),
    ("elbow", {"offset": 0.4}, (0.0, 1.0), lambda v: np.full(v.shape[1], 0.4)),
    ("elbow", {"coulomb": 0.6}, (0.0, 1.0), lambda v: 0.6 * np.sign(v[1])),
    ("belt", {"viscous": 0.5}, (1.0, 1.0), lambda v: 0.5 * (v[0] + v[1])),
    ("belt", {"coulomb": 0.5}, (1.0, 1.0), lambda v: 0.5 * np.sign(v[0] + v[1])),
]


@pytest.mark.parametrize(
    ("component", "values", "onto", "force"),
    CHANGES,
    ids=[f"{c}-{list(v)}" for c, v, _, _ in CHANGES],
)
def test_a_friction_acts_where_it_is(tmp_path, moved, component, values, onto, force):
    machine = described_arm(tmp_path, (TOML + COUPLED).replace("band = 25.0", ""))
    data = recording(moved[0], torques(*moved), (0.0, 0.0))
    plant = machine.configuration_of(data).plant
    model = model_of(machine, data, machine.configuration_of(data), 1)
    change = model.predict(with_parameters(plant, component, values)) - model.predict(plant)
    wanted = np.outer(onto, force(moved[1]))
    # Where it reverses, a tick early or late is no error of its size.
    assert np.median(np.abs(change - wanted)[:, INSIDE]) < 1e-3
    assert rms((change - wanted)[:, INSIDE]) < 0.05 * rms(wanted)


def test_a_rotor_turns_with_its_own_coordinate(tmp_path, moved):
    toml = TOML + '[components.pulley]\ntendon = "belt"\ntype = "rotor"\n'
    machine = described_arm(tmp_path, toml.replace("band = 25.0", ""))
    data = recording(moved[0], torques(*moved), (0.0, 0.0))
    plant = machine.configuration_of(data).plant
    assert plant.pulley.inertia == 0.04
    model = model_of(machine, data, machine.configuration_of(data), 1)
    change = model.predict(plant) - model.predict(
        with_parameters(plant, "pulley", {"inertia": 0.0})
    )
    wanted = 0.04 * np.tile(moved[2].sum(axis=0), (2, 1))
    assert rms((change - wanted)[:, INSIDE]) < 5e-3 * rms(wanted)


def test_noise_of_measured_angles_is_carried_into_the_torques(tmp_path, moved):
    machine = described_arm(tmp_path)
    true = torques(*moved)
    data = recording(moved[0], true, (1e-4, 0.0))
    configuration = machine.configuration_of(data)
    model = model_of(machine, data, configuration, 1)
    plant: Plant = configuration.plant
    carried = model.propagated_noise(plant)
    assert carried is not None
    error = model.predict(plant) - true
    for row in range(2):
        said, is_so = rms(carried[row, INSIDE]), rms(error[row, INSIDE])
        assert 0.5 < said / is_so < 2.0


def test_where_a_joint_rests_its_torque_says_nothing(tmp_path, moved):
    position, *_ = moved
    still = position.copy()
    still[1, 2000:] = still[1, 2000]
    machine = described_arm(tmp_path)
    data = recording(still, torques(*moved), (0.0, 0.0))
    found = MovedModel(machine, machine.replays[0], data).undetermined()
    assert found[1, 2100:-200].all()
    assert not found[0, 2100:-200].all()


def test_what_shares_nothing_is_searched_apart(tmp_path):
    alone = parts(described_arm(tmp_path))
    assert [[row.name for row in part.rows] for part in alone] == [["torque_1"], ["torque_2"]]
    assert {effect.group for effect in alone[0].effects()} == {"shoulder"}
    assert len(parts(described_arm(tmp_path, TOML + COUPLED))) == 1


MISTAKES = [
    (
        'sensor = "angle_2"',
        'sensor = "angle_2"\ntype = "velocity sensor"',
        "position sensor of each",
    ),
    (
        'moved_by = ["angle_1", "angle_2"]',
        'moved_by = ["angle_1", "angle_1"]',
        "moved by two sensors",
    ),
    (
        'moved_by = ["angle_1", "angle_2"]',
        'moved_by = "angle_1"',
        "band is for joints that move together",
    ),
    ("band = 25.0", "band = -1", "band"),
]


@pytest.mark.parametrize(("right", "wrong", "said"), MISTAKES, ids=[m[2] for m in MISTAKES])
def test_a_mistake_is_said_in_one_line(tmp_path, right, wrong, said):
    assert right in TOML
    with pytest.raises(RigtwinError, match=said) as caught:
        described_arm(tmp_path, TOML.replace(right, wrong))
    assert "\n" not in str(caught.value)


def test_what_of_the_model_is_not_taken_into_account_is_said(tmp_path):
    machine = described_arm(tmp_path)
    assert machine.overlooked == ("tendon belt: it is no component",)
    text = (tmp_path / "arm.xml").read_text()
    free = '<body pos="2 0 0"><freejoint name="ball"/><geom size=".1"/></body></worldbody>'
    (tmp_path / "arm.xml").write_text(text.replace("</worldbody>", free))
    found, mistakes = examine(tmp_path / "arm.toml")
    assert not mistakes
    assert found is not None
    assert any("joint ball: it is a free joint" in line for line in found.overlooked)


def test_friction_of_joints_and_of_a_coupling_is_found(tmp_path):
    machine = described_arm(tmp_path, TOML + COUPLED)
    moved = motion(10.0)
    torque = torques(*moved)
    torque[0] += 1.5 * np.sign(moved[1][0])
    torque += 0.8 * np.sign(moved[1].sum(axis=0))
    found = diagnose(machine, [recording(moved[0], torque, (2e-5, 0.05))])
    values = {
        str(effect.name): next(iter(effect.parameters.values())).value for effect in found.effects
    }
    assert set(values) == {"coulomb@shoulder", "coulomb@belt"}
    assert values["coulomb@shoulder"] == pytest.approx(1.5, rel=0.03)
    assert values["coulomb@belt"] == pytest.approx(0.8, rel=0.05)


def test_an_arm_that_is_as_described_has_no_gap(tmp_path):
    machine = described_arm(tmp_path)
    moved = motion(10.0)
    found = diagnose(machine, [recording(moved[0], torques(*moved), (2e-5, 0.05))])
    assert found.verdict == "no gap"
    assert not found.effects


def test_joints_that_share_nothing_are_one_answer(tmp_path):
    machine = described_arm(tmp_path)
    moved = motion(10.0)
    torque = torques(*moved)
    torque += np.array([[1.5], [0.6]]) * np.sign(moved[1])
    found = diagnose(machine, [recording(moved[0], torque, (2e-5, 0.05))])
    assert {str(effect.name) for effect in found.effects} == {"coulomb@shoulder", "coulomb@elbow"}
    assert found.corrected.plant.shoulder.coulomb == pytest.approx(1.5, rel=0.03)
    assert found.corrected.plant.elbow.coulomb == pytest.approx(0.6, rel=0.03)
    assert sum(effect.share for effect in found.effects) == pytest.approx(1.0, abs=0.05)
    assert found.gap is not None
    assert found.verdict == "explained"
    assert found.gap.after < 1.5  # dry friction that jumps a tick early or late
