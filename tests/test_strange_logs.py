"""Logs that are written strangely, but say what they mean."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin import RigtwinError
from rigtwin.importing.text import read_text
from rigtwin.recording import RecordedTest

MODEL = """
<mujoco>
  <worldbody>
    <body name="arm">
      <joint name="joint" axis="0 1 0" damping="0.3"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1" contype="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="joint"/></actuator>
</mujoco>
"""
TIME = 0.005 * np.arange(1000)
ANGLE = 0.8 * np.sin(2.0 * TIME)


def describe(folder: Path, log: dict[str, np.ndarray]) -> RecordedTest:
    path = folder / "arm.xml"
    path.write_text(MODEL)
    return rigtwin.describe(path, log).record()


@pytest.mark.parametrize(
    ("heading", "in_a_turn"),
    [
        ("joint_pos [rev]", 1.0),
        ("joint_pos [turns]", 1.0),
        ("joint_pos_rev", 1.0),
        ("joint_pos [gon]", 400.0),
        ("joint_pos_gon", 400.0),
    ],
)
def test_a_stated_unit_is_that_of_the_column(tmp_path: Path, heading: str, in_a_turn: float):
    angles = ANGLE * in_a_turn / (2.0 * np.pi)
    log = {"time": TIME, heading: angles, "joint_torque": np.cos(2.0 * TIME)}
    recording = describe(tmp_path, log)
    np.testing.assert_allclose(recording["/sensor.joint_position"], ANGLE, atol=1e-9)


@pytest.mark.parametrize(
    ("heading", "asked"),
    [("joint_pos [grad]", "degrees or in gon"), ("joint_pos_pct", "in percent")],
)
def test_a_unit_of_two_meanings_is_asked_for(tmp_path: Path, heading: str, asked: str):
    log = {"time": TIME, heading: 30.0 * ANGLE, "joint_torque": np.cos(2.0 * TIME)}
    with pytest.raises(RigtwinError, match=asked):
        describe(tmp_path, log)


def test_numbers_in_brackets_count_columns(tmp_path: Path):
    path = tmp_path / "log.csv"
    path.write_text(
        "t,q(1),q(2)\n" + "".join(f"{n * 0.01:.2f},{n / 7:.3f},1.5\n" for n in range(9))
    )
    assert list(read_text(path).values) == ["t", "q(1)", "q(2)"]


def test_two_rates_in_one_log_are_no_even_ticks(tmp_path: Path):
    steps = np.repeat([0.005, 0.0072], 500)
    time = np.cumsum(steps)
    log = {"time": time, "joint_pos": 0.8 * np.sin(2.0 * time), "joint_torque": np.cos(2.0 * time)}
    recording = describe(tmp_path, log)
    # The log is resampled: what was recorded at a time stays there.
    exact = 0.8 * np.sin(2.0 * (time[0] + recording.time))
    np.testing.assert_allclose(recording["/sensor.joint_position"], exact, atol=1e-3)


def test_whole_numbers_below_two_names_are_two_columns(tmp_path: Path):
    path = tmp_path / "log.csv"
    path.write_text("t_ms,counts\n" + "".join(f"{4 * n},{17 * n % 90}\n" for n in range(40)))
    columns = read_text(path)
    assert list(columns.values) == ["t_ms", "counts"]
    np.testing.assert_array_equal(columns.values["t_ms"], 4.0 * np.arange(40))


def test_a_first_row_that_counts_is_data_below_names(tmp_path: Path):
    path = tmp_path / "log.csv"
    rows = [f"{0.004 * n:g},{1 + 0.1 * n:g},{2 - 0.2 * n:g}" for n in range(40)]
    path.write_text("\n".join(["t,x,f", *rows]) + "\n")
    columns = read_text(path)
    assert rows[0] == "0,1,2"
    assert list(columns.values) == ["t", "x", "f"]
    assert len(columns.values["t"]) == 40


def test_blank_lines_between_rows_are_skipped(tmp_path: Path):
    path = tmp_path / "log.csv"
    rows = [f"{0.004 * n:.3f},{0.1 * n:.2f},{-0.2 * n:.2f}" for n in range(300)]
    path.write_text("\n\n".join(["t,x,f", *rows]) + "\n")
    columns = read_text(path)
    assert list(columns.values) == ["t", "x", "f"]
    np.testing.assert_allclose(columns.values["x"], 0.1 * np.arange(300), atol=0.006)


def test_a_counterweight_is_not_asked_for(tmp_path: Path):
    xml = """
    <mujoco>
      <worldbody>
        <body><joint name="lift_z" type="slide" axis="0 0 1"/><geom size="0.1" contype="0"/></body>
        <body><joint name="cw_z" type="slide" axis="0 0 1"/><geom size="0.1" contype="0"/></body>
      </worldbody>
      <equality><joint joint1="cw_z" joint2="lift_z" polycoef="0 -1 0 0 0"/></equality>
      <actuator><motor joint="lift_z"/></actuator>
    </mujoco>
    """
    path = tmp_path / "lift.xml"
    path.write_text(xml)
    log = {"time": TIME, "z_act": 0.1 * ANGLE, "motor_force": 30.0 * np.cos(2.0 * TIME)}
    recording = rigtwin.describe(path, log).record()
    np.testing.assert_allclose(recording["/sensor.lift_z_position"], 0.1 * ANGLE, atol=1e-9)


def test_a_column_is_stated_once(capsys: pytest.CaptureFixture[str]):
    from rigtwin.cli import main

    stated = ["--column", "a.position=x", "--column", "a.position=y"]
    assert main(["describe", "arm.xml", "--log", "log.csv", *stated]) != 0
    assert "a.position is stated twice" in capsys.readouterr().err
