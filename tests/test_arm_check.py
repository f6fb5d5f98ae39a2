"""The referee's arms: checked by energy and Lagrange's equations, scored by their table."""

from __future__ import annotations

import numpy as np
import pytest

from referee.arm import ArmResult, arm_rows, arm_table, is_right, is_wrong
from referee.arm_cases import (
    ACCEPTED,
    ANGLES,
    FORCES,
    GUIDES,
    MACHINES,
    NOMINAL,
    ROUND,
    ArmCase,
    draw_arm,
)
from referee.arm_recordings import build_arm, draw_travel, record_arm
from referee.arm_truth import (
    GRAVITY,
    Arm,
    JointTravel,
    Link,
    Resistance,
    add_ball,
    motor_forces,
    resisting_force,
)
from rigtwin.description.catalogue import find
from rigtwin.diagnosis.data_checks import find_faults
from rigtwin.recording import RecordedTest
from tests.helpers import arm

SMOOTH = np.random.default_rng(3)


def test_two_links_obey_lagranges_equations():
    moved = arm.motion(2.0)
    links = tuple(
        Link(length, mass, centre, 0.0, inertia)
        for length, mass, centre, inertia in zip(
            (arm.LENGTH, 0.3), arm.MASSES, arm.CENTRES, arm.INERTIAS, strict=True
        )
    )
    resistances = (Resistance(rotor=arm.ROTORS[0]), Resistance(rotor=arm.ROTORS[1], viscous=0.1))
    forces = motor_forces(
        Arm(None, links, resistances, Resistance(rotor=arm.BELT)), JointTravel(*moved)
    )
    assert forces == pytest.approx(arm.torques(*moved), abs=1e-9)


def test_a_cart_with_a_pendulum_obeys_lagranges_equations():
    travel = draw_travel("cart", SMOOTH)
    link, cart = Link(0.5, 2.0, 0.4, 0.0, 0.02), 6.0
    forces = motor_forces(Arm(cart, (link,), (Resistance(), Resistance())), travel)
    (_, angle), (_, rate), (push, gain) = travel
    swung = link.mass * link.along
    force = (cart + link.mass) * push + swung * (gain * np.cos(angle) - rate**2 * np.sin(angle))
    torque = (link.inertia + link.mass * link.along**2) * gain
    torque = torque + swung * np.cos(angle) * push + swung * GRAVITY * np.sin(angle)
    assert forces == pytest.approx(np.stack([force, torque]), abs=1e-9)


@pytest.mark.parametrize("machine", list(MACHINES))
def test_the_motors_work_equals_the_energy_lost_to_friction(machine):
    """Work of the motors over a whole period of a motion is what friction ate: energy comes back
    to where it was."""
    time = np.linspace(0.0, 4.0, 40001)
    w = 2.0 * np.pi / 4.0 * np.arange(1, len(GUIDES[machine]) + 1)[:, None]
    position = 0.3 * np.sin(w * time)
    rate = np.asarray(0.3 * w * np.cos(w * time), float)
    travel = JointTravel(position, rate, np.asarray(-0.3 * w**2 * np.sin(w * time), float))
    whole = NOMINAL[machine]
    bare = whole._replace(
        resistances=tuple(Resistance() for _ in whole.resistances), belt=Resistance()
    )
    power = np.sum(motor_forces(bare, travel) * travel.speed, axis=0)
    swing = float(np.max(np.abs(power)))
    assert abs(np.trapezoid(power, time)) < 1e-6 * swing
    lost = sum(
        resisting_force(drag, *(each[n] for each in travel)) * travel.speed[n]
        for n, drag in enumerate(whole.resistances)
    )
    lost = lost + resisting_force(whole.belt, *(each[-2:].sum(axis=0) for each in travel)) * np.sum(
        travel.speed[-2:], axis=0
    )
    taken = np.trapezoid(np.sum(motor_forces(whole, travel) * travel.speed, axis=0), time)
    assert taken == pytest.approx(np.trapezoid(lost, time), rel=1e-6)


def test_a_ball_adds_its_mass_and_inertia_to_a_link():
    link = add_ball(Link(0.4, 2.0, 0.1, 0.0, 0.02), 1.0, 0.4, 0.0, 0.0)
    assert (link.mass, link.along) == pytest.approx((3.0, 0.2))
    assert link.inertia == pytest.approx(0.02 + 2.0 * 0.1**2 + 1.0 * 0.2**2)


def test_seed_and_number_determine_a_case():
    assert [draw_arm(n, 1).sort for n in range(len(ROUND))] == list(ROUND)
    first, again = record_arm(draw_arm(3, 1)), record_arm(draw_arm(3, 1))
    for topic, names in first.columns.items():
        for name, values in names.items():
            assert np.array_equal(values, again.columns[topic][name])
    assert build_arm(draw_arm(3, 1)).magnitudes == first.magnitudes


@pytest.mark.parametrize("number", range(6))
def test_recordings_are_usable_and_acceptable_names_exist(tmp_path, number):
    case = draw_arm(number, 2)
    machine = find(MACHINES[case.machine])
    test = record_arm(case)
    ticks = len(next(iter(test.columns["/sensor"].values())))
    record = RecordedTest(
        tmp_path, machine.name, "", test.period, np.arange(ticks) * test.period, test.columns, {}
    )
    faults = find_faults(machine, record, machine.configuration_of(record))
    assert not [fault for fault in faults if fault.fatal]
    known = {effect.name for effect in machine.effects()}
    for joint in range(len(GUIDES[case.machine])):
        for word in ACCEPTED:
            names = ArmCase(case.machine, "single", ((word, joint),), 0, 0)
            accepted = names.accept((word, joint))
            # A position along a rail has no zero that could be seen, so it is no effect there.
            if accepted and (case.machine, word, joint) != ("cart", "zero", 0):
                assert accepted & known
    assert len(ANGLES[case.machine]) == len(FORCES[case.machine]) == len(GUIDES[case.machine])


def test_answers_are_scored_by_the_table():
    pair = ArmCase("arm_2", "pair", (("coulomb", 0), ("gain", 1)), 0, 1)

    def answer(*effects: str, verdict: str = "explained") -> dict[str, object]:
        said = [
            {"kind": each.split("@")[0], "component": each.split("@")[1], "parameters": {}}
            for each in effects
        ]
        return {"effects": said, "verdict": verdict, "seconds": 1.0}

    both = answer("coulomb@shoulder", "gain@torque_2")
    assert is_right(pair, both)
    assert not is_wrong(pair, both)
    assert not is_right(pair, answer("coulomb@shoulder"))
    assert is_wrong(pair, answer("coulomb@elbow", "gain@torque_2"))
    none = ArmCase("arm_2", "none", (), 1, 1)
    result = ArmResult(1, (pair, none), (both, answer(verdict="no gap")))
    values = {row.measure: row.value for row in arm_rows(result)}
    assert values["pairs on different joints: both"] == "1 of 1 (100.0 %)"
    assert values["false alarms"] == "0 of 1 (0.0 %)"
    assert "seed 1, 2 machines" in arm_table(result)
