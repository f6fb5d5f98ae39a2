"""What sums of inertial parameters forces can show."""

from __future__ import annotations

import numpy as np
import pytest

import rigtwin
from benchmarks import arms
from rigtwin.cli import main
from rigtwin.components.body import INERTIAL
from rigtwin.joints.base_parameters import find_base_parameters
from rigtwin.models.rigid import RigidBodies
from tests.helpers.arm import LENGTH, TOML, described_arm

BODIES = """
[components.upper]
body = "upper"
type = "body"

[components.lower]
body = "lower"
type = "body"

[components.rotor_1]
joint = "shoulder"
type = "rotor"
"""


def test_a_planar_arm_shows_the_six_sums_of_the_textbook(tmp_path):
    sums = find_base_parameters(described_arm(tmp_path, TOML + BODIES))
    expected = [
        {"rotor_1.inertia": 1.0, "upper.iyy": 1.0, "lower.mass": LENGTH**2},
        {"upper.mx": 1.0},
        {"upper.mz": 1.0, "lower.mass": -LENGTH},
        {"lower.mx": 1.0},
        {"lower.mz": 1.0},
        {"lower.iyy": 1.0},
    ]
    assert [dict(each) for each in sums] == [pytest.approx(each) for each in expected]


def test_what_keeps_every_sum_changes_no_force(tmp_path):
    lines = "".join(f'[components.l{n}]\nbody = "link_{n}"\ntype = "body"\n' for n in range(3))
    arms.describe(4, tmp_path)
    toml = tmp_path / "arm.toml"
    toml.write_text(toml.read_text().replace("[[replays]]", lines + "[[replays]]"))
    machine = rigtwin.machine(toml)
    sums = find_base_parameters(machine)
    names = [f"{part}.{word}" for part in ("l0", "l1", "l2", "tool") for word in INERTIAL]
    rows = np.array([[each.get(name, 0.0) for name in names] for each in sums])
    rows = rows[np.any(rows != 0.0, axis=1)]
    # Whatever is in none of the sums' directions.
    change = np.linalg.svd(rows)[2][len(rows) :].T @ np.ones(len(names) - len(rows))
    joints = [f"joint_{n}" for n in range(4)]
    bodies = RigidBodies(machine.model, joints, (), ())
    motion = np.random.default_rng(1).standard_normal((3, 4, 50))
    regressors = [bodies.regressor(motion, f"link_{n}") for n in range(4)]
    parts = [np.tensordot(change[10 * n : 10 * n + 10], regressors[n], 1) for n in range(4)]
    size = max(float(np.max(np.abs(part))) for part in parts)
    assert size > 0.1
    assert float(np.max(np.abs(sum(parts)))) < 1e-6 * size


def test_a_machine_without_bodies_has_none(tmp_path):
    assert find_base_parameters(described_arm(tmp_path)) == ()


@pytest.mark.slow
def test_machine_check_writes_the_sums(tmp_path, capsys):
    described_arm(tmp_path, TOML + BODIES)
    assert main(["machine", "check", str(tmp_path / "arm.toml")]) == 0
    said = capsys.readouterr().out
    assert "seen of bodies and rotors: upper.mz - 0.4 lower.mass" in said
