"""The referee's servos: checked beside MuJoCo, drawn by seed and number, scored by their table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pytest

from referee.servo import ServoResult, is_right, servo_rows, servo_table
from referee.servo_cases import (
    ACCEPTED,
    BESIDE,
    DESCRIPTION,
    NOMINAL,
    ROUND,
    draw_command,
    draw_servo,
    record_servo,
)
from referee.servo_truth import Array, ServoTruth, angles_under
from rigtwin.description.catalogue import find

PERIOD = 0.01


def angles_in_mujoco(servo: ServoTruth, command: Array) -> Array:
    """Return the angle of MuJoCo's own position actuator, rad, shape (rows,)."""
    text = (find(DESCRIPTION).model).read_text()
    text = text.replace("<option ", '<option timestep="5e-5" integrator="implicitfast" ')
    text = text.replace('armature="0.01"', f'armature="0.01" damping="{servo.viscous}"')
    text = text.replace('kp="30" kv="1.5"', f'kp="{servo.stiffness}" kv="{servo.damping}"')
    model = mujoco.MjModel.from_xml_string(text)
    data, angles = mujoco.MjData(model), np.empty(len(command))
    data.qpos[0] = command[0]
    late = round(servo.delay / PERIOD)
    for row in range(len(command)):
        angles[row], data.ctrl[0] = data.qpos[0], command[max(row - late, 0)]
        mujoco.mj_step(model, data, round(PERIOD / model.opt.timestep))
    return angles


@pytest.mark.parametrize(
    "servo",
    [
        NOMINAL,
        NOMINAL._replace(delay=3 * PERIOD),
        NOMINAL._replace(viscous=0.8),
        NOMINAL._replace(stiffness=60.0, damping=3.0),
    ],
)
def test_the_link_moves_as_in_mujoco(servo: ServoTruth) -> None:
    command = draw_command(PERIOD, np.random.default_rng(5))[:800]
    true = angles_in_mujoco(servo, command)
    assert np.std(angles_under(servo, command, PERIOD) - true) < 2e-3 * np.std(true)


def test_dry_friction_holds_the_link_within_its_limit() -> None:
    command = np.concatenate([np.zeros(10), np.full(90, 0.01)])
    servo = NOMINAL._replace(weight=0.0, coulomb=0.5)
    # 30 Nm/rad · 0.01 rad is less than 0.5 Nm.
    assert np.all(angles_under(servo, command, PERIOD) == 0.0)


def test_a_link_behind_a_play_hangs_at_its_lower_edge() -> None:
    command = np.full(500, 0.5)
    servo = NOMINAL._replace(play=0.06, viscous=0.3)
    angle = angles_under(servo, command, PERIOD)[-1]
    motor = angle + 0.03
    assert servo.stiffness * (0.5 - motor) == pytest.approx(servo.weight * np.sin(angle), rel=0.02)


def test_seed_and_number_determine_a_case() -> None:
    for number in range(len(ROUND)):
        first, second = (record_servo(draw_servo(number, 3)) for _ in range(2))
        assert first.truth == second.truth
        assert np.array_equal(
            first.columns["/sensor"]["encoder"], second.columns["/sensor"]["encoder"]
        )
    held_out = record_servo(draw_servo(2, 3), 1)
    assert held_out.truth == record_servo(draw_servo(2, 3)).truth


def test_acceptable_names_are_effects_of_the_description() -> None:
    effects = {effect.name for effect in find(DESCRIPTION).effects()}
    names = frozenset().union(*(n for sets in ACCEPTED.values() for n in sets), *BESIDE.values())
    assert names <= effects


def answer_of(names: Sequence[str]) -> dict[str, Any]:
    effects = [
        {"kind": kind, "component": component, "parameters": {"x": {"value": 0.0}}}
        for kind, component in (name.split("@") for name in names)
    ]
    return {"effects": effects, "verdict": "explained" if names else "no gap", "seconds": 1.0}


def test_answers_are_scored_by_the_table() -> None:
    cases = tuple(draw_servo(number, 3) for number in range(5))
    named = (["lag@servo"], [], ["viscous@joint"], ["delay@servo", "coulomb@joint"], ["mass@arm"])
    answers = tuple(answer_of(names) for names in named)
    right = [is_right(case, answer) for case, answer in zip(cases, answers, strict=True)]
    assert right == [True, True, False, True, False]
    result = ServoResult(3, cases, answers)
    measures = {row.measure: row.value for row in servo_rows(result)}
    assert measures["a wrong name"].startswith("2 of 5")
    assert "gains" in servo_table(result)
