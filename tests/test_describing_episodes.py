"""Logs that hold several tests one after another, and columns that only one joint can own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.episodes import episode_column, longest_test
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from tests.helpers.logs import PERIOD, arm_motion, write_arm, write_log

LENGTHS = (400, 900, 600)
CARTPOLE = """<mujoco><compiler angle="radian"/><worldbody><body name="cart">
<joint name="slider" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body name="pole"><joint name="hinge" axis="0 1 0"/>
<inertial pos="0 0 -0.5" mass="0.3" diaginertia="0.02 0.02 0.02"/></body></body></worldbody>
<actuator><motor name="force" joint="slider"/></actuator></mujoco>"""


def episodes() -> dict[str, np.ndarray]:
    """Cuts of an arm's motion, each with a time of its own."""
    motion, ends = arm_motion(), np.cumsum(LENGTHS)
    rows = np.concatenate(
        [np.arange(end - length, end) for end, length in zip(ends, LENGTHS, strict=True)]
    )
    columns = {
        "episode_index": np.repeat(np.arange(len(LENGTHS)), LENGTHS).astype(float),
        "time": np.concatenate([PERIOD * np.arange(length) for length in LENGTHS]),
    }
    return columns | {name: motion[name][rows] for name in ("q1", "tau1", "q2", "tau2")}


def test_each_episode_of_a_log_becomes_a_recording(tmp_path: Path):
    columns = episodes()
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.describe(write_arm(tmp_path), log, out=tmp_path / "written")
    recordings = answer.records()
    assert [recording.ticks for recording in recordings] == list(LENGTHS)
    last = columns["q2"][-LENGTHS[-1] :]
    assert recordings[2].column("/sensor", "elbow_position") == pytest.approx(last)
    assert any("3 tests, numbered by column episode_index" in note for note in answer.assumptions)
    assert "episode_index" not in answer.reading.unused
    with pytest.raises(RigtwinError, match="holds 3 tests; expected one"):
        answer.record()
    # The written map imports the same tests.
    imported = rigtwin.import_episodes(
        log, tmp_path / "written" / "map.toml", tmp_path / "out", machine=answer.machine
    )
    assert [recording.ticks for recording in imported] == list(LENGTHS)


@pytest.mark.slow
def test_a_diagnosis_takes_all_episodes_of_a_log(tmp_path: Path):
    columns = episodes()
    columns["tau2"] = columns["tau2"] + 0.3 * np.tanh(np.gradient(columns["q2"], PERIOD) / 0.01)
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.diagnose(log, machine=write_arm(tmp_path))
    # A note that all tests share is printed once.
    (note,) = (line for line in str(answer).splitlines() if "numbered by column" in line)
    assert note.strip().startswith("note: log.csv episode 0 and 2 more: ")


def test_a_second_log_may_hold_one_test_or_several(tmp_path: Path):
    columns = episodes()
    several = write_log(tmp_path / "several.csv", columns)
    rest = {name: values[: LENGTHS[0]] for name, values in columns.items()}
    one = write_log(tmp_path / "one.csv", {n: v for n, v in rest.items() if n != "episode_index"})
    model = write_arm(tmp_path)
    assert len(rigtwin.describe(model, several).records([one])) == 1
    assert len(rigtwin.describe(model, one).records([several])) == len(LENGTHS)


@pytest.mark.parametrize(
    ("name", "values", "counts"),
    [
        ("episode", [0] * 30 + [1] * 30, True),
        ("run_id", [3] * 30 + [1] * 30, True),
        ("episode", [0] * 60, False),
        ("episode", [0] * 30 + [1] * 4, False),
        ("episode", [0] * 30 + [1] * 30 + [0] * 30, False),
        ("episode", [0] * 30 + [0.5] * 30, False),
        ("episode_reward", [0] * 30 + [1] * 30, False),
        ("q", [0] * 30 + [1] * 30, False),
    ],
)
def test_only_a_number_of_tests_divides_a_log(name: str, values: list[float], counts: bool):
    columns = Columns({name: np.array(values, float)})
    assert episode_column(columns) == (name if counts else "")
    assert longest_test(columns).rows == (30 if counts else len(values))


@pytest.mark.parametrize(
    "names",
    [
        ("u", "x", "theta"),
        ("force_N", "cart_position_mm", "pole_angle_deg"),
        ("F", "cart", "angle"),
    ],
)
def test_columns_that_only_one_joint_can_own_are_matched(tmp_path: Path, names: tuple[str, ...]):
    time = PERIOD * np.arange(500)
    values = (np.sin(3.0 * time), 0.1 * np.cos(3.0 * time), 0.3 * np.sin(2.0 * time))
    (tmp_path / "model.xml").write_text(CARTPOLE)
    columns = {"t": time, **dict(zip(names, values, strict=True))}
    stated = {"slider.command": "F"} if names[0] == "F" else {}
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.describe(tmp_path / "model.xml", log, columns=stated)
    # The cart's force is commanded, and nothing drives the pole.
    assert answer.reading.kind.test == "inverse dynamics"
    assert {signal.key: signal.source for signal in answer.reading.signals} == {
        "slider.position": names[1],
        "hinge.position": names[2],
        "slider.force": names[0],
        "hinge.force": "0",
    }


def test_a_coordinate_is_no_angle(tmp_path: Path):
    time = PERIOD * np.arange(500)
    model = CARTPOLE.replace('type="slide" axis="1 0 0"', 'axis="0 1 0"')
    model = model.replace('<joint name="hinge" axis="0 1 0"/>', "")
    (tmp_path / "model.xml").write_text(model)
    columns = {"t": time, "torque": np.cos(time), "angle": np.sin(time), "x": np.sin(2.0 * time)}
    answer = rigtwin.describe(tmp_path / "model.xml", write_log(tmp_path / "log.csv", columns))
    assert {s.key: s.source for s in answer.reading.signals}["slider.position"] == "angle"
    assert "x" in answer.reading.unused


def test_a_unit_in_newtons_is_no_position(tmp_path: Path):
    time = PERIOD * np.arange(2000)
    model = (
        '<mujoco><worldbody><body name="table"><joint name="table" type="slide" axis="1 0 0" '
        'stiffness="50"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>'
        '<actuator><motor name="shaker" joint="table"/></actuator></mujoco>'
    )
    (tmp_path / "model.xml").write_text(model)
    position = 0.01 * np.sin(9.0 * time)
    columns = {"t": time, "shaker_N": (50.0 - 2.0 * 81.0) * position, "position": position}
    answer = rigtwin.describe(tmp_path / "model.xml", write_log(tmp_path / "log.csv", columns))
    found = {signal.key: (signal.source, signal.unit) for signal in answer.reading.signals}
    assert found == {"table.position": ("position", "m"), "table.force": ("shaker_N", "N")}


def test_a_joint_without_an_actuator_is_not_asked_for_its_force(tmp_path: Path):
    time = PERIOD * np.arange(500)
    (tmp_path / "model.xml").write_text(CARTPOLE)
    columns = {"t": time, "slider": 0.1 * np.cos(3.0 * time), "hinge": 0.3 * np.sin(2.0 * time)}
    columns["unknown"] = columns["hinge"]
    with pytest.raises(RigtwinError) as raised:
        rigtwin.describe(tmp_path / "model.xml", write_log(tmp_path / "log.csv", columns))
    assert "hinge.force" not in str(raised.value)
    assert "slider.command" in str(raised.value)
