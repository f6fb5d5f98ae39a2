"""Joints that act on each other, moved as measured: against equations written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import machines
import rigtwin
from rigtwin import import_data, run
from rigtwin.components import with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.document import examine, load
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.errors import RigtwinError
from rigtwin.joints.parts import parts
from rigtwin.models.inverse_dynamics import InverseDynamicsModel
from tests.helpers.arm import (
    BELT,
    COUPLED,
    TOML,
    URDF,
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
    assert machine.kind == "prescribed joints"
    true = torques(*moved)
    data = recording(moved[0], true, (0.0, 0.0))
    configuration = machine.configuration_of(data)
    found = machine.physics.model(machine, data.inputs, configuration, 1).predict(
        configuration.plant
    )
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
def test_friction_acts_on_its_own_coordinate(tmp_path, moved, component, values, onto, force):
    machine = described_arm(tmp_path, (TOML + COUPLED).replace("band = 25.0", ""))
    data = recording(moved[0], torques(*moved), (0.0, 0.0))
    plant = machine.configuration_of(data).plant
    model = machine.physics.model(machine, data.inputs, machine.configuration_of(data), 1)
    change = model.predict(with_parameters(plant, component, values)) - model.predict(plant)
    wanted = np.outer(onto, force(moved[1]))
    # Where it reverses, a tick early or late is no error of its size.
    off = np.abs(change - wanted)[:, INSIDE] > 2e-3
    assert float(np.mean(off)) < 0.01


def test_a_rotor_turns_with_its_own_coordinate(tmp_path, moved):
    toml = TOML + '[components.pulley]\ntendon = "belt"\ntype = "rotor"\n'
    machine = described_arm(tmp_path, toml.replace("band = 25.0", ""))
    data = recording(moved[0], torques(*moved), (0.0, 0.0))
    plant = machine.configuration_of(data).plant
    assert plant.pulley.inertia == 0.04
    model = machine.physics.model(machine, data.inputs, machine.configuration_of(data), 1)
    change = model.predict(plant) - model.predict(
        with_parameters(plant, "pulley", {"inertia": 0.0})
    )
    wanted = 0.04 * np.tile(moved[2].sum(axis=0), (2, 1))
    assert rms((change - wanted)[:, INSIDE]) < 5e-3 * rms(wanted)


def test_a_urdf_is_read_and_its_joints_are_sensed(tmp_path, moved):
    (tmp_path / "arm.urdf").write_text(URDF)
    lines = ["[machine]", 'name = "arm"', 'model = "arm.urdf"']
    for number, (joint, inertia) in enumerate((("shoulder", 0.05), ("elbow", 0.02)), start=1):
        for name, more in (
            (f"angle_{number}", 'type = "position sensor"'),
            (f"torque_{number}", 'type = "force sensor"'),
            (f"rotor_{number}", f'type = "rotor"\ninertia = {inertia}'),
        ):
            lines += [f"[components.{name}]", f'joint = "{joint}"', more, "effects = []"]
    lines += ["[[replays]]", 'moved_by = ["angle_1", "angle_2"]']
    lines += ['observe = ["torque_1", "torque_2"]']
    (tmp_path / "arm.toml").write_text("\n".join(lines))
    machine = load(tmp_path / "arm.toml")
    true = (
        torques(*moved)
        - BELT * moved[2].sum(axis=0)
        - np.stack([0.0 * moved[1][1], 0.1 * moved[1][1]])
    )
    data = recording(moved[0], true, (0.0, 0.0))
    configuration = machine.configuration_of(data)
    found = machine.physics.model(machine, data.inputs, configuration, 1).predict(
        configuration.plant
    )
    assert rms((found - true)[:, INSIDE]) < 2e-3 * rms(true)


def test_noise_of_measured_angles_is_carried_into_the_torques(tmp_path, moved):
    machine = described_arm(tmp_path)
    true = torques(*moved)
    data = recording(moved[0], true, (1e-4, 0.0))
    configuration = machine.configuration_of(data)
    model = machine.physics.model(machine, data.inputs, configuration, 1)
    plant: Plant = configuration.plant
    carried = model.propagated_noise(plant)
    assert carried is not None
    error = model.predict(plant) - true
    for row in range(2):
        said, is_so = rms(carried[row, INSIDE]), rms(error[row, INSIDE])
        assert 0.5 < said / is_so < 2.0


def test_torques_of_a_resting_joint_are_undetermined(tmp_path, moved):
    position, *_ = moved
    still = position.copy()
    still[1, 2000:] = still[1, 2000]
    machine = described_arm(tmp_path)
    data = recording(still, torques(*moved), (0.0, 0.0))
    found = InverseDynamicsModel(machine, machine.replays[0], data.inputs).undetermined()
    assert found[1, 2100:-200].all()
    assert not found[0, 2100:-200].all()


def test_independent_joints_are_searched_separately(tmp_path):
    alone = parts(described_arm(tmp_path))
    assert [[row.name for row in part.rows] for part in alone] == [["torque_1"], ["torque_2"]]
    assert {effect.group for effect in alone[0].effects()} == {"shoulder"}
    assert len(parts(described_arm(tmp_path, TOML + COUPLED))) == 1


MISTAKES = [
    (
        'sensor = "angle_2"',
        'joint = "elbow"\ntype = "velocity sensor"',
        "position sensor of each",
    ),
    (
        'moved_by = ["angle_1", "angle_2"]',
        'moved_by = ["angle_1", "angle_1"]',
        "is listed twice",
    ),
    (
        'moved_by = ["angle_1", "angle_2"]',
        'moved_by = "angle_1"',
        "band is for joints that move together",
    ),
    ("band = 25.0", "band = -1", "band"),
]


@pytest.mark.parametrize(("right", "wrong", "said"), MISTAKES, ids=[m[2] for m in MISTAKES])
def test_a_mistake_is_reported_in_one_line(tmp_path, right, wrong, said):
    assert right in TOML
    with pytest.raises(RigtwinError, match=said) as caught:
        described_arm(tmp_path, TOML.replace(right, wrong))
    assert "\n" not in str(caught.value)


def test_ignored_parts_of_the_model_are_reported(tmp_path):
    machine = described_arm(tmp_path)
    assert machine.overlooked == ("tendon belt: no component describes it",)
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


def test_an_arm_as_described_has_no_gap(tmp_path):
    machine = described_arm(tmp_path)
    moved = motion(10.0)
    found = diagnose(machine, [recording(moved[0], torques(*moved), (2e-5, 0.05))])
    assert found.verdict == "no gap"
    assert not found.effects


def test_independent_joints_give_one_answer(tmp_path):
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
    residuals = [step.residual for step in found.answer.steps]
    assert all(set(residual) == {"torque_1", "torque_2"} for residual in residuals)
    assert residuals[0]["torque_1"] > 10.0 * residuals[-1]["torque_1"]
    assert residuals[0]["torque_2"] > 10.0 * residuals[-1]["torque_2"]
    text = found.report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert "shoulder" in text
    assert "elbow" in text
    assert "[elbow]" in found.save_twin(tmp_path / "twin.toml").read_text(encoding="utf-8")
    assert found.gap.after < 1.5  # dry friction that jumps a tick early or late


EXPERIMENT = """
[experiments.swing]
duration = 4.0
period = 2e-3
[experiments.swing.demands]
angle_1 = "0.9 * sin(2 * time)"
angle_2 = "0.7 * sin(3 * time)"
"""


def test_the_twin_reads_the_force_that_its_motion_requires(tmp_path):
    machine = described_arm(tmp_path, TOML + COUPLED + EXPERIMENT)
    done = run(machine, "swing", effects={"viscous@belt": 0.5})
    time = done.time
    sizes, frequencies = np.array([[0.9], [0.7]]), np.array([[2.0], [3.0]])
    position = sizes * np.sin(frequencies * time)
    rate = sizes * frequencies * np.cos(frequencies * time)
    wanted = torques(position, rate, -(frequencies**2) * position) + 0.5 * rate.sum(axis=0)
    for joint in range(2):
        read = done.column("/sensor", f"torque_{joint + 1}")
        assert rms((read - wanted[joint])[INSIDE]) < 5e-3 * rms(wanted[joint])
        angle = done.column("/sensor", f"angle_{joint + 1}")
        assert np.allclose(angle, position[joint], rtol=0.0, atol=1e-9)


def test_a_missing_demand_is_named(tmp_path):
    missing = EXPERIMENT.replace('angle_2 = "0.7 * sin(3 * time)"', "")
    machine = described_arm(tmp_path, TOML + missing)
    with pytest.raises(RigtwinError, match=r"no demand for /sensor\.angle_2"):
        run(machine, "swing")


REAL = Path(__file__).parents[2] / "shared" / "real"
PUBLISHED = {
    "joint_1": (6.97, 8.11),
    "joint_2": (8.12, 5.60),
    "joint_3": (6.31, 1.98),
    "joint_4": (2.48, 1.11),
}
"""Coulomb Nm and viscous Nms/rad of the TX40, as its authors identified them."""


@pytest.mark.slow
@pytest.mark.skipif(not (REAL / "tx40").is_dir(), reason="the arm's records are not here")
def test_friction_of_a_real_arm_is_what_was_published(tmp_path):
    files = [REAL / "tx40" / f"{name}_data.csv" for name in ("pos_read", "curr")]
    maps = Path(machines.__file__).parent / "maps"
    data = import_data(files, maps / "tx40.toml", tmp_path / "tx40.mcap")
    found = rigtwin.diagnose(data)
    values = {str(e.name): next(iter(e.parameters.values())).value for e in found.effects}
    assert found.verdict == "partly explained"
    kinds = {effect.name.kind for effect in found.effects if effect.name.component != "joint_2"}
    assert kinds == {"coulomb", "viscous"}
    for joint, (coulomb, viscous) in PUBLISHED.items():
        assert values[f"coulomb@{joint}"] == pytest.approx(coulomb, rel=0.08)
        assert values[f"viscous@{joint}"] == pytest.approx(viscous, rel=0.08)
    # Published for q5' and q6' apart: what goes with their sum counts at joint 5 too.
    assert values["coulomb@joint_5"] == pytest.approx(3.03, rel=0.08)
    assert values["viscous@joint_5"] + values["viscous@wrist"] == pytest.approx(1.86, rel=0.08)
    assert values["coulomb@wrist"] == pytest.approx(2.03, rel=0.08)
    assert values["viscous@wrist"] == pytest.approx(0.60, rel=0.12)
    assert found.gap is not None
    assert found.gap.shrinkage_held_out.low > 0.85


@pytest.mark.slow
@pytest.mark.skipif(not (REAL / "double_pendulum").is_dir(), reason="its records are not here")
def test_friction_of_a_real_double_pendulum_is_part_of_what_is_there(tmp_path):
    maps = Path(machines.__file__).parent / "maps"
    records = [
        import_data(
            REAL / "double_pendulum" / f"{name}.csv",
            maps / "double_pendulum.toml",
            tmp_path / f"{name}.mcap",
        )
        for name in ("055640", "055903", "060143", "060245", "060329", "060440")
    ]
    found = rigtwin.diagnose(records[:4], held_out=records[4:])
    assert found.verdict == "partly explained"
    values = {str(e.name): next(iter(e.parameters.values())).value for e in found.effects}
    # Friction that grows with the load is a refinement of it that these data ask for.
    assert {"coulomb@shoulder", "coulomb@elbow"} <= set(values)
    assert set(values) <= {"coulomb@shoulder", "coulomb@elbow", "load_friction@elbow"}
    assert all(0.09 < values[f"coulomb@{joint}"] < 0.155 for joint in ("shoulder", "elbow"))
    assert any("torque_1" in place.component for place in found.answer.leftovers)
