"""Raw logs of machines that others measured, and of strangers' models: what they are taken for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.matching import match_columns
from rigtwin.describing.quantity import JointQuantity
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from tests.helpers.logs import SERVOS, arm_motion, write_arm, write_log

REAL = Path(__file__).parents[2] / "shared" / "real"
XML = Path(__file__).parents[1] / "models" / "xml"
needs_real = pytest.mark.skipif(not REAL.is_dir(), reason="needs recordings that are not shipped")
PENDULUM = """<mujoco model="pendulum"><compiler angle="radian"/><worldbody><body name="rod">
<joint name="pivot" axis="0 1 0"/><inertial pos="0 0 -0.3" mass="0.2" diaginertia="1e-7 1e-7 1e-7"/>
</body></worldbody><actuator><motor name="motor" joint="pivot"/></actuator></mujoco>"""
"""A stranger's minimal model of a pendulum."""


@needs_real
@pytest.mark.parametrize(
    ("model", "log", "test", "sources"),
    [
        (
            REAL / "aalborg_pendulum" / "model1.xml",
            REAL / "aalborg_pendulum" / "pendulum1_early.csv",
            "force commands",
            {"pivot.position": "angle", "pivot.command": "torque"},
        ),
        (
            REAL / "aalborg_cart" / "model.xml",
            REAL / "aalborg_cart" / "stroke1.csv",
            "inverse dynamics",
            {"rail.position": "position", "rail.force": "force"},
        ),
        (
            XML / "double_pendulum.xml",
            REAL / "double_pendulum" / "055640.csv",
            "inverse dynamics",
            {
                "shoulder.position": "pos1",
                "elbow.position": "pos2",
                "shoulder.force": "tau1",
                "elbow.force": "tau2",
            },
        ),
        (
            REAL / "go2_leg" / "model_FL.xml",
            REAL / "go2_leg" / "FL.csv",
            "servos",
            {
                **{f"{joint}.position": joint for joint in ("hip", "thigh", "calf")},
                **{f"{joint}.command": f"{joint}_command" for joint in ("hip", "thigh", "calf")},
            },
        ),
    ],
    ids=["pendulum", "cart", "double pendulum", "leg"],
)
def test_a_raw_log_is_read_without_a_question(model, log, test, sources):
    answer = rigtwin.describe(model, log)
    assert answer.reading.kind.test == test
    assert {s.key: s.source for s in answer.reading.signals} == sources
    assert answer.record().ticks > 1000


@needs_real
def test_servos_whose_torques_have_no_sign_follow_their_commands():
    log = REAL / "so101" / "chirp_sweep.csv"
    answer = rigtwin.describe(REAL / "so101" / "model.xml", log)
    assert answer.reading.kind.test == "position commands"
    assert len(answer.machine.replays) == 6
    assert "a magnitude" in answer.reading.unused["rotation_torque"]
    second = answer.record([REAL / "so101" / "multisine.csv"])
    assert second.channels == answer.record().channels


@needs_real
def test_a_column_without_a_meaning_is_offered_as_the_force_with_its_factor():
    log = REAL / "emps" / "DATA_EMPS.mat"
    with pytest.raises(RigtwinError, match=r"'vir' explains 100 % .* 35\.\d+ N a unit"):
        rigtwin.describe(XML / "emps.xml", log)
    answer = rigtwin.describe(XML / "emps.xml", log, columns={"carriage.force": "35.15065 * vir"})
    assert answer.reading.kind.test == "inverse dynamics"


@pytest.mark.slow
@needs_real
def test_an_arm_with_gears_is_asked_about_once_and_read_by_formulas():
    log = [REAL / "tx40" / "pos_read_data.csv", REAL / "tx40" / "curr_data.csv"]
    with pytest.raises(RigtwinError, match=r"named as the time.*are currents; what force"):
        rigtwin.describe(REAL / "tx40" / "tx40.urdf", log)
    stated = {"time": "2e-4"}
    for number, gear in enumerate((32, 32, 45, -48, 45, 32), start=1):
        stated[f"joint_{number}.position"] = f"pos_read_data.Joint_{number} / {gear}"
        stated[f"joint_{number}.force"] = f"{gear} * curr_data.Joint_{number}"
    answer = rigtwin.describe(XML / "tx40.xml", log, columns=stated)
    assert answer.reading.kind.test == "inverse dynamics"
    assert answer.machine.components["wrist"].element == "tendon"
    # A factor that the owner states is believed.
    assert answer.machine.components["torque_1"].kinds == frozenset()
    beside = "+".join(map(str, log))
    assert rigtwin.describe(XML / "tx40.xml", beside, columns=stated).log.files == tuple(log)


def test_a_motor_whose_command_is_zero_leaves_the_joint_free(tmp_path: Path):
    (tmp_path / "rod.xml").write_text(PENDULUM)
    time = np.arange(0.0, 10.0, 0.01)
    swing = 0.5 * np.exp(-0.1 * time) * np.cos(5.7 * time)
    log = write_log(
        tmp_path / "log.csv", {"time": time, "torque": np.zeros_like(time), "angle": swing}
    )
    answer = rigtwin.describe(tmp_path / "rod.xml", log)
    assert answer.reading.kind.test == "force commands"
    assert "swing freely" in answer.reading.kind.why
    assert answer.machine.components["motor"].kinds == frozenset()
    write_log(tmp_path / "log.csv", {"time": time, "angle": swing})
    with pytest.raises(RigtwinError, match=r"nothing says what moves pivot.*pivot.command=0"):
        rigtwin.describe(tmp_path / "rod.xml", log)
    free = rigtwin.describe(tmp_path / "rod.xml", log, columns={"pivot.command": "0"})
    assert not np.any(free.record().column("/command", "motor"))


def test_a_turn_more_than_once_could_be_rad_or_degrees(tmp_path: Path):
    (tmp_path / "rod.xml").write_text(PENDULUM)
    time = np.arange(0.0, 10.0, 0.01)
    log = write_log(
        tmp_path / "log.csv",
        {"time": time, "torque": np.sin(time), "angle": 20.0 * np.sin(3.0 * time)},
    )
    with pytest.raises(RigtwinError, match=r"are these rad or degrees\?"):
        rigtwin.describe(tmp_path / "rod.xml", log)


def test_a_joint_without_a_column_is_said_to_rest(tmp_path: Path):
    motion = arm_motion()
    columns = {"time": motion["time"], "shoulder_pos": motion["q1"]}
    columns["shoulder_torque"] = motion["tau1"]
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.describe(write_arm(tmp_path), log)
    assert answer.reading.joints == ("shoulder",)
    assert any("elbow: no column is the position" in note for note in answer.assumptions)


def test_commands_without_an_actuator_ask_for_one(tmp_path: Path):
    motion = arm_motion()
    columns = {"time": motion["time"]}
    for joint, column in (("shoulder", "q1"), ("elbow", "q2")):
        columns |= {f"{joint}_pos": motion[column], f"{joint}_target": motion[column]}
    log = write_log(tmp_path / "log.csv", columns)
    with pytest.raises(RigtwinError, match='add <position joint="shoulder"/>'):
        rigtwin.describe(write_arm(tmp_path), log)


def test_a_lerobot_row_is_matched(tmp_path: Path):
    names = [f"{kind}.{joint}.pos" for kind in ("observation.state", "action") for joint in JOINTS]
    columns = Columns({name: np.zeros(3) for name in ("timestamp", "frame_index", *names)})
    matches, unused = match_columns(
        Mechanism(write_arm(tmp_path, SERVOS)), columns, skipped=["timestamp"]
    )
    assert {(m.joint, m.quantity) for m in matches} == {
        (joint, quantity)
        for joint in JOINTS
        for quantity in (JointQuantity.POSITION, JointQuantity.COMMAND)
    }
    assert list(unused) == ["frame_index"]


JOINTS = ("shoulder", "elbow")


@pytest.mark.parametrize(
    ("replay", "said"),
    [
        ('test = "force comands"', "did you mean 'force commands'"),
        ('test = "servos"', "joint shoulder has no position actuator"),
        ('test = "inverse dynamics"\njoints = ["wrist"]', "'wrist' is no hinge or slide"),
        ('test = "inverse dynamics"\njoints = []', "expected a list of joints"),
        ('test = "inverse dynamics"\nfree = ["elbow"]', "leave one of them out"),
    ],
)
def test_a_mistake_in_a_test_that_implies_components_is_said(tmp_path: Path, replay, said):
    write_arm(tmp_path)
    head = '[machine]\nname = "arm"\nmodel = "arm.xml"\n[[replays]]\n'
    (tmp_path / "arm.toml").write_text(head + replay)
    with pytest.raises(RigtwinError, match=said):
        rigtwin.machine(tmp_path / "arm.toml")
