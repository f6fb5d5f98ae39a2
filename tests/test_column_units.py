"""Units that columns state by their names or above the data, and forces before a gear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.heading import read_words, split_words, stated_unit
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.signal import LogSignal
from rigtwin.errors import RigtwinError

LEVER, INERTIA, PERIOD = 0.5, 0.02, 5e-3
TIME = PERIOD * np.arange(2000)
SWING = 0.4 * np.sin(2.0 * TIME) + 0.1 * np.sin(9.0 * TIME)
TORQUE = INERTIA * (-0.4 * 4.0 * np.sin(2.0 * TIME) - 0.1 * 81.0 * np.sin(9.0 * TIME))
SHAFT = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="rotor">
<joint name="shaft" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
</body></worldbody>
<actuator><motor name="drive" joint="shaft" gear="{LEVER}"/></actuator></mujoco>"""


def read(folder: Path, model: str, heading: str, *columns: np.ndarray) -> dict[str, LogSignal]:
    """Signals of a log with these lines above its data, by their names."""
    (folder / "model.xml").write_text(model)
    rows = "\n".join(",".join(f"{cell:.9g}" for cell in row) for row in zip(*columns, strict=True))
    (folder / "log.csv").write_text(f"{heading}\n{rows}\n")
    answer = rigtwin.describe(folder / "model.xml", folder / "log.csv")
    return {signal.key: signal for signal in answer.reading.signals}


@pytest.mark.parametrize(
    ("name", "unit", "quantity"),
    [
        ("yaw_torque_mNm", "mNm", JointQuantity.FORCE),
        ("target_torque_Nm_0", "Nm", JointQuantity.FORCE),
        ("grip_force_mN_2", "mN", JointQuantity.FORCE),
        ("Force (kN)", "kN", JointQuantity.FORCE),
        ("elbow_deg_s", "deg/s", JointQuantity.VELOCITY),
        ("theta_rad_per_s", "rad/s", JointQuantity.VELOCITY),
        ("elbow_iref_A", "", JointQuantity.CURRENT),
        ("posref_1", "", JointQuantity.POSITION),
        ("elbow_deg", "deg", JointQuantity.POSITION),
    ],
)
def test_a_name_states_a_unit_and_a_quantity(name: str, unit: str, quantity: JointQuantity) -> None:
    words = split_words(name)
    assert stated_unit(words) == unit
    assert read_words(words, "").quantity is quantity


def test_a_word_that_only_begins_like_a_short_form_stays_whole() -> None:
    assert split_words("ident_inset_posture") == ("ident", "inset", "posture")


def test_a_current_reference_is_the_control_of_a_motor(tmp_path: Path) -> None:
    signals = read(tmp_path, SHAFT, "t,shaft_rad,shaft_iref_A", TIME, SWING, TORQUE / LEVER)
    assert signals["shaft.command"].column == "shaft_iref_A"


def test_a_force_in_newtons_acts_on_a_hinge_through_the_gear(tmp_path: Path) -> None:
    signals = read(tmp_path, SHAFT, "t,shaft_rad,drive_force_N", TIME, SWING, TORQUE / LEVER)
    force = signals["shaft.force"]
    assert force.unit == "N"
    assert force.scale == pytest.approx(LEVER)
    assert "0.5 Nm/N" in force.assumed[0]


@pytest.mark.parametrize(
    "remark", ["# encoder: 4096 counts/rev", "# CPR = 4096", "# 4096 ticks per turn"]
)
def test_counts_are_read_with_what_the_log_says_of_a_turn(tmp_path: Path, remark: str) -> None:
    counts = np.round(4096 * SWING / (2.0 * np.pi))
    signals = read(
        tmp_path, SHAFT, f"{remark}\nt,shaft_counts,shaft_torque_Nm", TIME, counts, TORQUE
    )
    position = signals["shaft.position"]
    assert position.unit == "rev"
    assert position.scale == pytest.approx(1.0 / 4096.0)


@pytest.mark.parametrize("remark", ["# bench 3", "# motor 2048 counts/rev, load 4096 counts/rev"])
def test_counts_of_an_unknown_turn_are_asked_for(tmp_path: Path, remark: str) -> None:
    counts = np.round(4096 * SWING / (2.0 * np.pi))
    with pytest.raises(RigtwinError, match="is in counts; how many of them make a turn"):
        read(tmp_path, SHAFT, f"{remark}\nt,shaft_counts,shaft_torque_Nm", TIME, counts, TORQUE)


FINGER = """<mujoco><option gravity="0 0 0"/><worldbody><body name="proximal">
<joint name="knuckle" axis="0 0 1" stiffness="0.1" damping="0.004"/>
<inertial pos="0.02 0 0" mass="0.04" diaginertia="1e-5 1e-5 1e-5"/>
<body name="distal" pos="0.04 0 0"><joint name="tip" axis="0 0 1" stiffness="0.05" damping="0.002"/>
<inertial pos="0.02 0 0" mass="0.03" diaginertia="1e-5 1e-5 1e-5"/></body></body></worldbody>
<tendon><fixed name="cord"><joint joint="knuckle" coef="0.012"/><joint joint="tip" coef="0.008"/>
</fixed></tendon><actuator><motor name="winch" tendon="cord"/></actuator></mujoco>"""


def test_a_motor_on_a_tendon_moves_the_joints_that_it_passes(tmp_path: Path) -> None:
    tension = 2.0 + np.sin(3.0 * TIME)
    knuckle, tip = 0.12 * tension, 0.16 * tension
    signals = read(
        tmp_path, FINGER, "t,knuckle_rad,tip_rad,tension_cmd_N", TIME, knuckle, tip, tension
    )
    assert set(signals) == {"knuckle.position", "tip.position", "knuckle.command"}


def test_two_tendons_of_one_joint_are_refused(tmp_path: Path) -> None:
    second = '<fixed name="back"><joint joint="knuckle" coef="-0.012"/></fixed></tendon>'
    model = FINGER.replace("</tendon>", second).replace(
        "</actuator>", '<motor name="release" tendon="back"/></actuator>'
    )
    with pytest.raises(RigtwinError, match="pulls a tendon"):
        read(
            tmp_path,
            model,
            "t,knuckle_rad,tip_rad,winch_cmd,release_cmd",
            *(TIME, SWING, SWING, SWING, SWING),
        )
