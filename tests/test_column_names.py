"""Columns that name a joint by a part of its name, by elimination, or in the encoder's counts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.heading import read_words, split_words
from rigtwin.describing.quantity import JointQuantity
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

LEG = """<mujoco><compiler angle="radian" autolimits="true"/><option gravity="0 0 0"/><worldbody>
<body name="thigh"><joint name="hip_pitch" axis="0 1 0" range="-2 2" damping="0.1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
<body name="calf" pos="0 0 -0.2"><joint name="knee" axis="0 1 0" range="-2 2" damping="0.1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body></body></worldbody>
<actuator><position name="p1" joint="hip_pitch" kp="20" kv="1"/>
<position name="p2" joint="knee" kp="20" kv="1"/></actuator></mujoco>"""
SHAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="rotor">
<joint name="shaft" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
</body></worldbody><actuator><motor name="drive" joint="shaft" gear="0.5"/></actuator></mujoco>"""
MOTOR = '<motor name="drive" joint="shaft" gear="0.5"/>'
PERIOD, ROWS, INERTIA, TORQUE_CONSTANT = 5e-3, 2000, 0.02, 0.5
TIME = PERIOD * np.arange(ROWS)
SWING = 0.4 * np.sin(2.0 * TIME) + 0.1 * np.sin(9.0 * TIME)
ACCELERATION = -0.4 * 4.0 * np.sin(2.0 * TIME) - 0.1 * 81.0 * np.sin(9.0 * TIME)


def sources(
    folder: Path, model: str, columns: Mapping[str, Array], **stated: str
) -> dict[str, str]:
    """Names of the signals that a log holds, and their columns."""
    (folder / "model.xml").write_text(model)
    log = write_log(folder / "log.csv", {"time": TIME, **columns})
    named = {key.replace("__", "."): text for key, text in stated.items()}
    answer = rigtwin.describe(folder / "model.xml", log, columns=named)
    return {signal.key: signal.source for signal in answer.reading.signals}


def test_a_word_of_one_joints_name_identifies_it(tmp_path: Path) -> None:
    columns = {"q_hip": SWING, "q_knee": SWING, "q_des_hip": SWING, "q_des_knee": SWING}
    assert sources(tmp_path, LEG, columns) == {
        "hip_pitch.position": "q_hip",
        "knee.position": "q_knee",
        "hip_pitch.command": "q_des_hip",
        "knee.command": "q_des_knee",
    }


def test_a_word_beside_another_joints_word_identifies_nothing(tmp_path: Path) -> None:
    columns = {"q_hip_yaw": SWING, "q_knee": SWING, "q_des_knee": SWING}
    with pytest.raises(RigtwinError, match=r"position of hip_pitch, and q_hip_yaw fits no joint"):
        sources(tmp_path, LEG, columns)
    rests = sources(tmp_path, LEG, columns, hip_pitch__position="none")
    assert rests == {"knee.position": "q_knee", "knee.command": "q_des_knee"}


@pytest.mark.parametrize("name", ["current_set", "i_ref_current", "coil"])
def test_a_current_or_the_only_column_left_is_the_command(tmp_path: Path, name: str) -> None:
    current = INERTIA * ACCELERATION / TORQUE_CONSTANT
    known = sources(tmp_path, SHAFT, {"angle": SWING, name: current})
    assert known == {"shaft.position": "angle", "shaft.command": name}


@pytest.mark.parametrize("name", ["current_set", "coil"])
def test_a_column_that_moves_nothing_is_no_command(tmp_path: Path, name: str) -> None:
    noise = np.random.default_rng(3).standard_normal(ROWS)
    with pytest.raises(RigtwinError, match=r"shaft.command|no column is a measured force"):
        sources(tmp_path, SHAFT, {"angle": SWING, name: noise})


@pytest.mark.parametrize(
    ("steps", "is_asked"),
    [((360 / 4096, 360 / 4096), False), ((0.0803, 0.0944), True), ((0.0803, 0.0803), True)],
)
def test_counts_of_an_encoder_tell_degrees_from_percent(
    tmp_path: Path, steps: tuple[float, float], is_asked: bool
) -> None:
    angles = [step * np.round(np.degrees(SWING) / step) for step in steps]
    columns = {"hip_pitch.pos": angles[0], "knee.pos": angles[1]}
    columns |= {"hip_pitch.cmd": angles[0], "knee.cmd": angles[1]}
    if is_asked:
        with pytest.raises(RigtwinError, match="or a share of the joint's range in percent"):
            sources(tmp_path, LEG, columns)
    else:
        assert sources(tmp_path, LEG, columns)["knee.position"] == "knee.pos"


@pytest.mark.parametrize(
    ("column", "quantity"),
    [
        ("current_position", JointQuantity.POSITION),
        ("currentVelocity", JointQuantity.VELOCITY),
        ("current_force", JointQuantity.FORCE),
        ("motor_current", JointQuantity.CURRENT),
        ("current_q", JointQuantity.CURRENT),
    ],
)
def test_the_current_position_is_no_current(column: str, quantity: JointQuantity) -> None:
    assert read_words(split_words(column), "").quantity is quantity


def test_the_current_of_a_motor_is_its_force_where_the_models_constant_agrees(
    tmp_path: Path,
) -> None:
    current = INERTIA * ACCELERATION / TORQUE_CONSTANT
    columns = {"shaft_pos": SWING, "current (mA)": 1e3 * current}
    assert sources(tmp_path, SHAFT, columns)["shaft.force"] == "current"
    log = write_log(tmp_path / "log.csv", {"time": TIME, **columns})
    force = rigtwin.describe(tmp_path / "model.xml", log).record()["/sensor.shaft_force"]
    assert force == pytest.approx(INERTIA * ACCELERATION, abs=1e-6)


def test_a_current_of_another_constant_is_asked_about(tmp_path: Path) -> None:
    current = 3.0 * INERTIA * ACCELERATION / TORQUE_CONSTANT
    with pytest.raises(RigtwinError, match="is it that force"):
        sources(tmp_path, SHAFT, {"shaft_pos": SWING, "current (A)": current})


def test_the_current_of_a_motor_is_its_control_in_a_test_of_force_commands(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(SHAFT)
    current = INERTIA * ACCELERATION / TORQUE_CONSTANT
    columns = {"time": TIME, "shaft_pos": SWING, "current (A)": current}
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.describe(tmp_path / "model.xml", log, test="force commands")
    assert answer.record()["/command.drive"] == pytest.approx(current, abs=1e-6)


def test_the_gain_of_a_servo_is_no_gear(tmp_path: Path) -> None:
    servo = SHAFT.replace(MOTOR, '<position joint="shaft" kp="50" name="drive"/>')
    columns = {"shaft_pos": SWING, "shaft_torque": INERTIA * ACCELERATION / 50.0}
    with pytest.raises(RigtwinError, match="before a gear"):
        sources(tmp_path, servo, columns)


@pytest.mark.parametrize(
    ("position", "command"),
    [("W_ist", "W_soll"), ("Winkel", "Sollwert Winkel"), ("shaf_act", "shaf_set")],
)
def test_set_points_are_read_in_german_and_by_abbreviated_names(
    tmp_path: Path, position: str, command: str
) -> None:
    servo = SHAFT.replace(MOTOR, '<position joint="shaft" kp="50" kv="1" name="drive"/>')
    known = sources(tmp_path, servo, {position: SWING, command: np.roll(SWING, 3)})
    assert known == {"shaft.position": position, "shaft.command": command}


def test_an_abbreviation_of_two_joints_identifies_neither(tmp_path: Path) -> None:
    model = LEG.replace("hip_pitch", "knob")
    with pytest.raises(RigtwinError, match="kn_pos"):
        sources(tmp_path, model, {"kn_pos": SWING, "kn_cmd": SWING})


@pytest.mark.parametrize("sides", [("motor_enc", "load_enc"), ("motor_enc",)])
def test_what_the_joint_does_is_read_behind_the_gear(
    tmp_path: Path, sides: tuple[str, ...]
) -> None:
    """An encoder on the motor reads the joint's angle times the gear."""
    sensors = """<sensor><actuatorpos name="motor_enc" actuator="drive"/>
<jointpos name="load_enc" joint="shaft"/></sensor></mujoco>"""
    (tmp_path / "model.xml").write_text(SHAFT.replace("</mujoco>", sensors))
    read = {"motor_enc": 0.5 * SWING, "load_enc": SWING}
    columns = {"time": TIME, **{f"{side}_rad": read[side] for side in sides}}
    columns["drive_cmd"] = INERTIA * ACCELERATION / 0.5
    log = write_log(tmp_path / "log.csv", columns)
    recording = rigtwin.describe(tmp_path / "model.xml", log).record()
    assert recording["/sensor.load_enc"] == pytest.approx(SWING, abs=1e-6)


@pytest.mark.parametrize(("other", "word"), [("load_shaft", "load"), ("link_joint", "link")])
def test_a_general_word_identifies_a_joint_without_another(
    tmp_path: Path, other: str, word: str
) -> None:
    model = LEG.replace("hip_pitch", "motor_shaft").replace("knee", other)
    columns = {"motor angle [rad]": SWING, f"{word} angle [rad]": SWING}
    columns |= {"motor_shaft_cmd": SWING, f"{other}_cmd": SWING}
    known = sources(tmp_path, model, columns)
    assert known["motor_shaft.position"] == "motor angle"
    assert known[f"{other}.position"] == f"{word} angle"


def test_a_log_of_the_time_alone_is_said_to_be_one(tmp_path: Path) -> None:
    with pytest.raises(RigtwinError, match="the log has no other column than the time; say"):
        sources(tmp_path, SHAFT, {})


def test_columns_that_count_from_zero_mean_places_and_not_the_models_names(tmp_path: Path) -> None:
    model = LEG.replace('name="p1"', 'name="effort1"').replace('name="p2"', 'name="effort2"')
    columns = {f"position{place} [rad]": SWING for place in range(2)}
    columns |= {"effort0": 0.1 * ACCELERATION, "effort1": 0.04 * ACCELERATION}
    known = sources(tmp_path, model, columns)
    assert known["hip_pitch.force"] == "effort0"
    assert known["knee.force"] == "effort1"


def test_a_moment_about_an_axis_is_a_joints_force_beside_its_name_alone(tmp_path: Path) -> None:
    columns = {"shaft_pos": SWING, "Mz_shaft": INERTIA * ACCELERATION, "mx": SWING, "temps": TIME}
    assert sources(tmp_path, SHAFT, columns)["shaft.force"] == "Mz_shaft"
    del columns["Mz_shaft"]
    with pytest.raises(RigtwinError, match="no column is a measured force"):
        sources(tmp_path, SHAFT, columns)


GANTRY = """<mujoco><worldbody>
<body name="a"><joint name="X" type="slide" axis="1 0 0"/><geom size="0.1" mass="5"/>
<body name="b"><joint name="Y" type="slide" axis="0 1 0"/><geom size="0.1" mass="2"/></body></body>
</worldbody><actuator><general name="mx" joint="X" gainprm="60"/>
<general name="my" joint="Y" gainprm="40"/></actuator></mujoco>"""
WHEEL = """<mujoco><worldbody><body name="rod"><joint name="pivot" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="0.2"/>
<body name="disc" pos="0 0 -0.2"><joint name="wheel" axis="0 1 0" damping="0.01"/>
<geom type="cylinder" size="0.05 0.01" euler="90 0 0" mass="0.4"/></body></body></worldbody>
<actuator><motor name="bldc" joint="wheel"/></actuator></mujoco>"""


@pytest.mark.parametrize("name", ["I_X_A", "i_x_A"])
def test_a_current_may_be_called_i_with_its_axis(name: str) -> None:
    assert split_words(name) == ("current", "x", "amp")
    assert split_words("theta_A") == ("theta", "a")


def test_the_only_position_left_is_that_of_the_only_joint_left(tmp_path: Path) -> None:
    columns = {"pend_angle_deg": SWING, "wheel_angle_deg": SWING, "wheel_torque_Nm": SWING}
    found = sources(tmp_path, WHEEL, columns)
    assert found["pivot.position"] == "pend_angle_deg"


def test_the_path_of_a_column_says_where_its_signal_is_from(tmp_path: Path) -> None:
    prefix = "Model Root/Bench/left cell/"
    columns = {f"{prefix}{name}": SWING for name in ("X_pos_mm", "Y_pos_mm", "X_force", "Y_force")}
    found = sources(tmp_path, GANTRY, columns)
    assert found["X.position"] == f"{prefix}X_pos_mm"
    assert found["Y.position"] == f"{prefix}Y_pos_mm"
