"""Benchmarks beside other tools: both tools get the same physics, and the score is right."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from benchmarks import fit as fits
from benchmarks import peers
from benchmarks.toolbox import (
    find_missing,
    harden_friction,
    invert,
    list_stribeck,
    measure_inverse,
    set_joint,
    set_mass,
)
from referee.arm_cases import MACHINES, NOMINAL, ArmCase
from referee.arm_recordings import draw_travel
from referee.arm_truth import motor_forces


def test_the_free_arm_moves_as_in_mujoco():
    commands, _ = fits.simulate_free_arm(1)
    commands = commands[:1000]
    parameters = np.array([0.0, 1.1, 0.0, 0.42, 2.1])
    angles, expected = np.empty_like(commands), np.empty_like(commands)
    fits.swing_free_arm(commands, angles, parameters, 1e-4)
    spec = mujoco.MjSpec.from_string(fits.FREE_ARM)
    spec.option.timestep = 1e-4
    set_joint("shoulder", "damping")(spec, 1.1)
    set_joint("elbow", "damping")(spec, 0.42)
    set_mass("forearm")(spec, 2.1)
    model = spec.compile()
    data = mujoco.MjData(model)
    for tick, command in enumerate(commands):
        expected[tick] = data.qpos
        data.ctrl[:] = command
        mujoco.mj_step(model, data, 20)
    assert np.std(angles) > 0.1
    assert angles == pytest.approx(expected, abs=5e-4)


def test_dry_friction_slows_the_free_arm():
    commands, _ = fits.simulate_free_arm(1)
    free, rubbed = np.empty((500, 2)), np.empty((500, 2))
    fits.swing_free_arm(commands[:500], free, np.array([0.0, 1.1, 0.0, 0.42, 2.1]), 1e-4)
    fits.swing_free_arm(commands[:500], rubbed, np.array([0.9, 1.1, 0.4, 0.42, 2.1]), 1e-4)
    # Each joint first moves away from rest: friction holds it back.
    assert np.all(np.abs(rubbed[40]) < np.abs(free[40]))


@pytest.mark.parametrize("name", sorted(MACHINES))
def test_the_toolbox_gets_the_forces_of_the_referee(name):
    machine = rigtwin.machine(MACHINES[name])
    travel = draw_travel(name, np.random.default_rng(1))
    motion = np.stack(travel)
    spec = peers.nominal_spec(machine, Path(MACHINES[name]).with_suffix(".xml"))
    forces = invert(spec.compile(), motion) + list_stribeck(machine, motion)
    expected = motor_forces(NOMINAL[name], travel)
    share = np.std(forces - expected, axis=1) / np.std(expected, axis=1)
    # Friction reverses within a tick or so of the motion.
    assert np.all(share < 0.01)


def test_soft_friction_would_reverse_too_late():
    machine = rigtwin.machine(MACHINES["arm_2"])
    travel = draw_travel("arm_2", np.random.default_rng(1))
    motion = np.stack(travel)
    spec = peers.nominal_spec(machine, Path(MACHINES["arm_2"]).with_suffix(".xml"))
    hard = invert(spec.compile(), motion)
    for joint in spec.joints:
        joint.solref_friction = np.array([0.02, 1.0])
    spec.option.timestep = 0.002
    soft = invert(spec.compile(), motion)
    assert np.max(np.abs(soft - hard)) > 1.0
    harden_friction(spec)
    assert invert(spec.compile(), motion) == pytest.approx(hard)


def test_a_measured_motion_is_differentiated():
    time = np.arange(3000) * 2e-3
    angle = np.sin(3.0 * time)
    test = measure_inverse(angle[None], angle[None], 2e-3, 25.0)
    position, velocity, acceleration = test.motion[:, 0, test.compared]
    assert position == pytest.approx(angle[test.compared], abs=1e-4)
    assert velocity == pytest.approx(3.0 * np.cos(3.0 * time[test.compared]), abs=1e-3)
    assert acceleration == pytest.approx(-9.0 * np.sin(3.0 * time[test.compared]), abs=1e-2)


COULOMB = ArmCase("arm_2", "single", (("coulomb", 0),), 0, 1)
SOUND = ArmCase("arm_2", "none", (), 1, 1)


@pytest.mark.parametrize(
    ("case", "names", "word"),
    [
        (COULOMB, {"coulomb@shoulder"}, "right"),
        (COULOMB, {"coulomb@elbow"}, "wrong"),
        (COULOMB, {"coulomb@shoulder", "gain@torque_1"}, "wrong"),
        (COULOMB, set(), "missed"),
        (SOUND, set(), "right"),
        (SOUND, {"coulomb@shoulder"}, "false alarm"),
    ],
)
def test_a_score_says_what_was_right(case, names, word):
    (problem,) = peers.draw_problems(1, 44)
    problem = peers.replace(problem, case=case)
    assert peers.score(problem, peers.Attempt(frozenset(names), 0.01, 1.0)) == word


def test_a_method_without_names_has_no_score():
    (problem,) = peers.draw_problems(1, 44)
    assert peers.score(problem, peers.Attempt(None, 0.01, 1.0)) == ""


def test_the_table_counts_what_each_method_said():
    (problem,) = peers.draw_problems(1, 44)
    pairs = [
        (peers.replace(problem, case=case), peers.Attempt(frozenset(names), 0.01, 2.0))
        for case, names in (
            (COULOMB, {"coulomb@shoulder"}),
            (COULOMB, {"coulomb@elbow"}),
            (SOUND, {"coulomb@elbow"}),
        )
    ]
    row = peers.summary({"method": pairs})[-1]
    assert peers.remark({"method": pairs}).endswith("the least time that of the method (2.0 s).")
    assert row == "| method | 1 of 3 | 1 of 2 | 0 of 2 | 1 of 1 | 1.00 % (1.00) | 2.0 |"


def test_a_quantity_that_is_independent_of_the_motion_does_not_pay():
    assert peers.bic(0.5, 100.0, 1) < peers.bic(1.0, 100.0, 0)
    assert peers.bic(0.999, 100.0, 1) > peers.bic(1.0, 100.0, 0)


@pytest.mark.skipif(bool(find_missing()), reason="needs rigtwin[peers]")
def test_the_toolbox_finds_the_values_that_rigtwin_finds():
    contest = fits.pose_moved()
    values = fits.fit_toolbox(contest.parameters, contest.residual, "scipy")
    for name, true in contest.truth.items():
        assert values[name] == pytest.approx(true, rel=0.15, abs=0.03), name
