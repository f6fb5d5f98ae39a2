"""The referee's machines of other physics: checked against closed forms, scored by their table."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from referee.friction_truth import ElasticTruth, FrictionTruth
from referee.imposed_truth import imposed_force
from referee.reliability import draw_reliability
from referee.sensor_truth import SensorTruth, read_sensor
from referee.wild import SURE, WildResult, judge_names, reliability, wild_rows, wild_table
from referee.wild_cases import ACCEPTED, MACHINES, ROUND, SORTS, WildCase, draw_wild
from referee.wild_recordings import record_wild
from referee.wild_truth import FINE, FollowerTruth, drive_pendulum, follow_command
from rigtwin.description.catalogue import find
from rigtwin.diagnosis.data_checks import find_faults
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest

PERIOD = 1e-3


def ramp(speed: float, seconds: float = 1.0) -> np.ndarray:
    return speed * np.arange(round(seconds / PERIOD) * FINE) * PERIOD / FINE


def test_a_steady_motion_meets_kinetic_and_viscous_friction():
    r = FrictionTruth(slip=50.0, breakaway=1.5, fade_speed=0.01, bristle=1e-5, viscous=300.0)
    force = imposed_force(r, ElasticTruth(), ramp(0.1), PERIOD)
    assert force[-1] == pytest.approx(50.0 + 0.1 * 300.0, rel=1e-6)
    slowly = imposed_force(r, ElasticTruth(), ramp(1e-4), PERIOD)
    assert slowly[-1] == pytest.approx(50.0 * 1.5 + 1e-4 * 300.0, rel=1e-3)


def test_a_bristle_is_a_spring_before_it_slips():
    r = FrictionTruth(slip=50.0, bristle=1e-3)
    force = imposed_force(r, ElasticTruth(), ramp(1e-4, 0.1), PERIOD)
    assert force[-1] == pytest.approx(50.0 / 1e-3 * 1e-5, rel=0.02)


def test_warming_up_takes_friction_away():
    r = FrictionTruth(slip=50.0, warming_loss=0.4, warming_time=0.5)
    force = imposed_force(r, ElasticTruth(), ramp(0.1, 4.0), PERIOD)
    assert force[-1] == pytest.approx(50.0 * (1.0 - 0.4 * (1.0 - math.exp(-8.0))), rel=1e-3)


def test_a_damper_on_a_compliant_frame_is_a_maxwell_element():
    c, k, speed = 500.0, 2e4, 0.05
    force = imposed_force(FrictionTruth(viscous=c), ElasticTruth(frame=k), ramp(speed, 0.2), PERIOD)
    time = np.arange(len(force)) * PERIOD
    expected = c * speed * (1.0 - np.exp(-time * k / c))
    assert np.max(np.abs(force - expected)[2:]) < 0.02 * c * speed


def test_after_a_reversal_the_frame_is_a_spring_until_friction_slips():
    """After a reversal the frame lets go over 2·F/k."""
    slip, k, speed = 50.0, 1e4, 0.02
    forward = ramp(speed, 1.0)
    force = imposed_force(
        FrictionTruth(slip=slip),
        ElasticTruth(frame=k),
        np.concatenate([forward, forward[::-1]]),
        PERIOD,
    )
    back = np.arange(len(force) // 2) * PERIOD * speed
    expected = np.maximum(slip - k * back, -slip)
    assert np.max(np.abs(force[len(force) // 2 :] - expected)) < 0.02 * slip


def test_a_rider_adds_its_mass_slowly():
    time = np.arange(40000) * PERIOD / FINE
    x = 0.01 * np.sin(2.0 * math.pi * time)
    bending = ElasticTruth(rider=2.0, frequency=20.0, ratio=0.5)
    force = imposed_force(FrictionTruth(), bending, x, PERIOD)
    expected = -2.0 * (2.0 * math.pi) ** 2 * x[::FINE]
    late = slice(2000, None)
    assert np.std((force - expected)[late]) < 0.1 * np.std(expected[late])


def test_a_pendulum_swings_with_its_own_period():
    inertia, arm = 0.02, 1.0
    angle = drive_pendulum(
        FrictionTruth(), ElasticTruth(), inertia, arm, 0.02, np.zeros(2000), 0.0, PERIOD
    )
    expected = 0.02 * np.cos(math.sqrt(arm / inertia) * np.arange(2000) * PERIOD)
    assert np.max(np.abs(angle - expected)) < 2e-4


def test_a_lag_follows_a_step():
    command = np.concatenate([np.zeros(1), np.ones(200)])
    moved = follow_command(FollowerTruth(lag=0.02), command, PERIOD)
    time = np.arange(200) * PERIOD
    assert np.max(np.abs(moved[1:] - (1.0 - np.exp(-time / 0.02)))) < 1e-9


def test_a_channel_is_delayed_and_quantised():
    random, signal = np.random.default_rng(1), np.sin(np.arange(1000) * 0.01)
    late = read_sensor(random, signal, SensorTruth(delay=0.005), PERIOD)
    assert np.max(np.abs(late[5:] - signal[:-5])) < 1e-9
    coarse = read_sensor(random, signal, SensorTruth(bit=0.1), PERIOD)
    assert np.allclose(coarse / 0.1, np.round(coarse / 0.1))


def every_case() -> list[WildCase]:
    count = len(ROUND) * max(len(sorts) for sorts in SORTS.values())
    cases = {(case.machine, case.parts): case for n in range(count) if (case := draw_wild(n, 0))}
    return list(cases.values())


def load(case: WildCase) -> RecordedTest:
    data = record_wild(case)
    ticks = len(next(iter(next(iter(data.columns.values())).values())))
    time = np.arange(ticks) * data.period
    name = find(MACHINES[case.machine]).name
    return RecordedTest(Path("wild"), name, "", data.period, time, data.columns, {})


@pytest.mark.parametrize("case", every_case(), ids=lambda c: f"{c.machine}-{'-'.join(c.parts)}")
def test_every_case_has_accepted_names_and_usable_reproducible_data(case: WildCase):
    assert set(case.parts) <= set(ACCEPTED)
    machine, recording = find(MACHINES[case.machine]), load(case)
    configuration = machine.configuration_of(recording)
    faults = [f for f in find_faults(machine, recording, configuration) if f.fatal]
    assert faults == []
    # The same seed gives the same bytes.
    again = record_wild(case)
    for topic, columns in recording.columns.items():
        for name, values in columns.items():
            assert values.tobytes() == again.columns[topic][name].tobytes()


def test_every_machine_is_drawn_and_has_an_acceptable_name():
    cases = every_case()
    assert {case.machine for case in cases} == set(MACHINES)
    for case in cases:
        known = {effect.name for effect in find(MACHINES[case.machine]).effects()}
        assert case.accepted & known


def answer(*effects: tuple[str, float, float]) -> dict[str, Any]:
    named = []
    for name, confidence, value in effects:
        kind, _, component = name.partition("@")
        interval = {"value": value, "low": 0.9 * value, "high": 1.1 * value}
        named.append(
            {
                "kind": kind,
                "component": component,
                "confidence": confidence,
                "parameters": {kind: interval},
            }
        )
    return {"verdict": "explained", "effects": named, "seconds": 1.0}


def test_names_are_scored_by_the_table_of_acceptable_answers():
    case = WildCase("damper", ("viscous", "lugre"), 0, 1)
    answers = (
        answer(("coulomb@damper", 0.9, 1.0), ("viscous@damper", 0.9, 1.0)),
        answer(("coulomb@damper", 0.9, 1.0), ("backlash@damper", 0.6, 1.0)),
        answer(),
        answer(("lag@load_cell", 0.85, 1.0)),
    )
    result = WildResult(1, (case,) * 4, answers)
    values = {row.measure: row.value for row in wild_rows(result)}
    assert values["a wrong family named"].startswith("2 of 4")
    assert values["named, and all of it acceptable"].startswith("1 of 4")
    assert values["nothing named"].startswith("1 of 4")
    assert values[f"acceptable of names at {SURE} or more"].startswith("3 of 4")
    assert sum(count for *_, count in reliability(judge_names(result))) == 5
    assert "not backlash@damper" in wild_table(result)


def test_reliability_is_drawn(tmp_path):
    path = draw_reliability([(0.8, 0.9, 10), (0.97, 1.0, 300)], tmp_path / "r.svg")
    assert "300" in path.read_text()
    with pytest.raises(RigtwinError, match="cannot write"):
        draw_reliability([], tmp_path / "r.xyz")
