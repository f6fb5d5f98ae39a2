"""Machines that are described from a model and a log: what is taken for what, and what is asked."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.describing.described import Described
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import MOTORS, PERIOD, SERVOS, arm_motion, write_arm, write_log

Columns = Mapping[str, Array]
NOMINAL = {"shoulder": 0.0, "elbow": 0.0}


@pytest.fixture(scope="module")
def motion() -> Columns:
    return arm_motion()


def renamed(columns: Columns, names: Mapping[str, str]) -> dict[str, Array]:
    """The columns that are named, under other names."""
    return {new: columns[old] for old, new in names.items()}


def described(
    folder: Path, columns: Columns, rest: str = "", test: str = "", **stated: str
) -> Described:
    log = write_log(folder / "log.csv", columns)
    keys = {key.replace("__", "."): text for key, text in stated.items()}
    return rigtwin.describe(write_arm(folder, rest), log, columns=keys, test=test)


def sources(answer: Described) -> dict[str, str]:
    return {signal.key: signal.source for signal in answer.reading.signals}


def units(answer: Described) -> dict[str, str]:
    return {signal.key: signal.unit for signal in answer.reading.signals}


PLAIN = ("time", "q1", "tau1", "q2", "tau2")
NAMINGS = {
    "numbered": PLAIN,
    "numbered from nought": ("t", "position[0]", "effort[0]", "position[1]", "effort[1]"),
    "by joint": ("timestamp", "shoulder.pos", "shoulder.torque", "elbow.pos", "elbow.torque"),
    "joint states": (
        "time",
        "/joint_states/shoulder/position",
        "/joint_states/shoulder/effort",
        "/joint_states/elbow/position",
        "/joint_states/elbow/effort",
    ),
    "capitals": ("Time", "ShoulderAngle", "ShoulderTorque", "ElbowAngle", "ElbowTorque"),
    "no word for the position": ("t", "shoulder", "tau_shoulder", "elbow", "tau_elbow"),
}


@pytest.mark.parametrize("names", NAMINGS.values(), ids=list(NAMINGS))
def test_joints_are_matched_by_many_namings(
    tmp_path: Path, motion: Columns, names: tuple[str, ...]
):
    answer = described(tmp_path, renamed(motion, dict(zip(PLAIN, names, strict=True))))
    assert answer.reading.kind.test == "inverse dynamics"
    assert sources(answer) == {
        "shoulder.position": names[1],
        "elbow.position": names[3],
        "shoulder.force": names[2],
        "elbow.force": names[4],
    }
    recording = answer.record()
    assert recording.column("/sensor", "elbow_position") == pytest.approx(motion["q2"])
    assert recording.period == pytest.approx(PERIOD)


def test_the_longest_name_of_a_joint_decides(tmp_path: Path, motion: Columns):
    model = tmp_path / "arm.xml"
    write_arm(tmp_path)
    model.write_text(model.read_text().replace('"shoulder"', '"wrist_elbow"'))
    columns = {"time": motion["time"], "wrist_elbow_pos": motion["q1"], "elbow_pos": motion["q2"]}
    columns |= {"wrist_elbow_torque": motion["tau1"], "elbow_torque": motion["tau2"]}
    answer = rigtwin.describe(model, write_log(tmp_path / "log.csv", columns))
    assert sources(answer)["wrist_elbow.position"] == "wrist_elbow_pos"
    assert sources(answer)["elbow.position"] == "elbow_pos"


@pytest.mark.parametrize(("prefix", "suffix"), [("robot0_", "_joint"), ("FL_", "_joint")])
def test_words_that_all_joints_share_need_not_be_in_the_log(
    tmp_path: Path, motion: Columns, prefix: str, suffix: str
):
    model = write_arm(tmp_path)
    text = model.read_text()
    for joint in NOMINAL:
        text = text.replace(f'"{joint}"', f'"{prefix}{joint}{suffix}"')
    model.write_text(text)
    columns = renamed(motion, dict(zip(PLAIN, NAMINGS["by joint"], strict=True)))
    answer = rigtwin.describe(model, write_log(tmp_path / "log.csv", columns))
    assert sources(answer)[f"{prefix}elbow{suffix}.position"] == "elbow.pos"
    assert sources(answer)[f"{prefix}shoulder{suffix}.force"] == "shoulder.torque"


DEGREES: dict[str, Callable[[Columns], dict[str, Array]]] = {
    "in brackets": lambda c: _degrees(c, "q1 [deg]", "q2 [deg]"),
    "in the name": lambda c: _degrees(c, "shoulder_deg", "elbow_deg"),
    "by range": lambda c: _degrees(c, "q1", "q2"),
}


def _degrees(columns: Columns, first: str, second: str) -> dict[str, Array]:
    turned = {name: np.degrees(columns[old]) for name, old in ((first, "q1"), (second, "q2"))}
    return {"time": columns["time"], **turned, "tau1": columns["tau1"], "tau2": columns["tau2"]}


@pytest.mark.parametrize("written", DEGREES.values(), ids=list(DEGREES))
def test_degrees_are_seen(tmp_path: Path, motion: Columns, written):
    answer = described(tmp_path, written(motion))
    assert units(answer)["elbow.position"] == "deg"
    seen = answer.record().column("/sensor", "elbow_position")
    assert seen == pytest.approx(motion["q2"], abs=1e-6)


def test_a_unit_by_range_is_an_assumption_that_is_said(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, DEGREES["by range"](motion))
    assert any("deg by its range" in line for line in answer.assumptions)
    assert any("deg by its range" in note for note in answer.record().notes)
    assert "deg by its range" in str(answer)


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [("t", 1e3, "ms"), ("time", 1e6, "us"), ("stamp", 1e9, "ns"), ("time_ms", 1e3, "ms")],
)
def test_time_units_are_seen(tmp_path: Path, motion: Columns, name: str, factor: float, unit: str):
    columns = {
        name: np.round(factor * motion["time"]),
        **renamed(motion, {k: k for k in PLAIN[1:]}),
    }
    answer = described(tmp_path, columns)
    assert answer.reading.clock.unit == unit
    assert answer.record().period == pytest.approx(PERIOD)


def test_a_step_that_fits_two_units_is_asked_about(tmp_path: Path, motion: Columns):
    columns = {"t": 120.0 * np.arange(len(motion["time"]))}
    with pytest.raises(RigtwinError, match=r"in what unit is it\?.*t \[ms\].*t \[us\]"):
        described(tmp_path, {**columns, **renamed(motion, {k: k for k in PLAIN[1:]})})


def test_a_log_without_a_time_asks_for_it_and_takes_a_period(tmp_path: Path, motion: Columns):
    columns = renamed(motion, {k: k for k in PLAIN[1:]})
    with pytest.raises(RigtwinError, match="no column is named as the time"):
        described(tmp_path, columns)
    answer = described(tmp_path, columns, time="0.004")
    assert answer.record().period == PERIOD


def test_a_log_that_says_nothing_is_refused_in_one_line(tmp_path: Path, motion: Columns):
    short = {name: values[:3] for name, values in motion.items()}
    with pytest.raises(RigtwinError, match="it has 3 rows; expected at least 50"):
        described(tmp_path, short)
    broken = {**motion, "time": motion["time"].copy()}
    broken["time"][5] = np.nan
    with pytest.raises(RigtwinError, match="time column 'time' is not a number in row 6"):
        described(tmp_path, broken)
    still = {name: np.full_like(values, 0.3) for name, values in motion.items()}
    answer = described(tmp_path, {**still, "time": motion["time"]})
    with pytest.raises(RigtwinError, match="it is a recording already"):
        rigtwin.describe(tmp_path / "arm.xml", answer.record())  # type: ignore[arg-type]


def test_several_runs_in_one_file_are_refused(tmp_path: Path, motion: Columns):
    with pytest.raises(RigtwinError, match="goes back in row 1002; several runs"):
        described(tmp_path, {**motion, "time": motion["time"] % (1001 * PERIOD)})


def test_a_column_of_another_quantity_is_asked_about(tmp_path: Path, motion: Columns):
    columns = {"time": motion["time"], "q1": motion["q1"], "q2": motion["q2"]}
    columns |= {"tau1 [V]": motion["tau1"], "tau2 [V]": motion["tau2"]}
    with pytest.raises(RigtwinError, match=r"'tau1' is in V, .* how much is one V\?"):
        described(tmp_path, columns)


def test_a_name_that_fits_two_joints_is_not_taken(tmp_path: Path, motion: Columns):
    columns = {**motion, "shoulder_elbow": motion["q1"]}
    answer = described(tmp_path, columns)
    assert answer.reading.unused["shoulder_elbow"] == "its name fits joints shoulder, elbow alike"


def test_uneven_rows_are_resampled_and_that_is_said(tmp_path: Path, motion: Columns):
    rows = np.delete(np.arange(len(motion["time"])), [300, 301, 302])
    answer = described(tmp_path, {name: values[rows] for name, values in motion.items()})
    assert answer.record().period == PERIOD
    assert any("uneven in time" in line for line in answer.assumptions)


def test_a_torque_of_the_other_sign_is_turned_and_that_is_said(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, {**motion, "tau2": -motion["tau2"]})
    assert sources(answer)["elbow.force"] == "-tau2"
    assert any("elbow.force" in line and "sign turned" in line for line in answer.assumptions)
    seen = answer.record().column("/sensor", "elbow_force")
    assert seen == pytest.approx(motion["tau2"])


def test_a_torque_before_a_gear_is_asked_about(tmp_path: Path, motion: Columns):
    columns = {**motion, "tau1": motion["tau1"] / 50.0, "tau2": motion["tau2"] / 50.0}
    with pytest.raises(RigtwinError, match=r"before a gear\?.*elbow.force=[45]\d.* \* tau2"):
        described(tmp_path, columns)
    stated = {"shoulder__force": "50 * tau1", "elbow__force": "50 * tau2"}
    answer = described(tmp_path, columns, **stated)
    assert answer.record().column("/sensor", "elbow_force") == pytest.approx(motion["tau2"])


def test_currents_are_asked_about_with_the_factor_that_the_model_needs(
    tmp_path: Path, motion: Columns
):
    names = {"time": "time", "q1": "q1", "q2": "q2", "tau1": "current1", "tau2": "current2"}
    columns = renamed(arm_motion(NOMINAL), names)
    columns |= {name: columns[name] / 4.0 for name in ("current1", "current2")}
    with pytest.raises(RigtwinError, match=r"explains \d+ % of the force.*shoulder.force=(4|3.9)"):
        described(tmp_path, columns)


def test_two_columns_that_fit_one_quantity_are_asked_about(tmp_path: Path, motion: Columns):
    columns = {**motion, "angle1": motion["q1"] + 0.01, "angle2": motion["q2"] + 0.01}
    with pytest.raises(RigtwinError, match=r"q1, angle1 could all be shoulder.position"):
        described(tmp_path, columns)
    stated = {"shoulder__position": "q1", "elbow__position": "angle2"}
    assert sources(described(tmp_path, columns, **stated))["elbow.position"] == "angle2"


def test_percent_of_a_range_and_degrees_are_asked_about(tmp_path: Path, motion: Columns):
    columns = {"timestamp": motion["time"]}
    for number, joint in ((1, "shoulder"), (2, "elbow")):
        columns[f"observation.state.{joint}.pos"] = np.degrees(motion[f"q{number}"])
        columns[f"action.{joint}.pos"] = np.degrees(motion[f"q{number}"])
    with pytest.raises(RigtwinError, match=r"share of the joint's range in percent\?"):
        described(tmp_path, columns, SERVOS)
    stated = {"*__position": "[deg]"}
    answer = described(tmp_path, columns, SERVOS, **stated)
    assert answer.reading.kind.test == "servos"
    assert sources(answer)["elbow.command"] == "action.elbow.pos"
    assert units(answer)["elbow.command"] == "deg"


def commanded(columns: Columns, sign: float = 1.0) -> dict[str, Array]:
    """A log of commands, and of positions that follow 40 ms later."""
    late = round(0.04 / PERIOD)
    log = {"time": columns["time"]}
    for number in (1, 2):
        place = columns[f"q{number}"]
        log[f"q{number}_cmd"] = sign * np.concatenate([place[late:], np.full(late, place[-1])])
        log[f"q{number}"] = place
    return log


def test_commands_of_damped_position_actuators_are_servos(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, commanded(motion), SERVOS)
    assert answer.reading.kind.test == "servos"
    (replay,) = answer.machine.replays
    assert replay.free == ("shoulder", "elbow")


def test_position_actuators_without_damping_model_no_servo(tmp_path: Path, motion: Columns):
    undamped = SERVOS.replace('kv="4"', "").replace('kv="2"', "")
    answer = described(tmp_path, commanded(motion), undamped)
    assert answer.reading.kind.test == "position commands"
    assert [replay.name for replay in answer.machine.replays] == ["shoulder", "elbow"]
    assert "damping of shoulder" in answer.reading.kind.why


def test_a_command_of_the_other_sign_is_turned(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, commanded(motion, -1.0), SERVOS)
    assert sources(answer)["elbow.command"] == "-q2_cmd"
    seen = answer.record().column("/command", "elbow_servo")
    assert np.corrcoef(seen, motion["q2"])[0, 1] > 0.9


def test_torques_of_all_joints_are_held_against_inverse_dynamics(tmp_path: Path, motion: Columns):
    """The motion that an arm's torques predict runs away from the measured one."""
    names = {"time": "time", "q1": "q1", "q2": "q2", "tau1": "tau_cmd1", "tau2": "tau_cmd2"}
    answer = described(tmp_path, renamed(motion, names), MOTORS)
    assert answer.reading.kind.test == "inverse dynamics"
    assert {row.name for row in answer.machine.rows} == {"shoulder_force", "elbow_force"}
    stated = described(tmp_path, motion, MOTORS, test="force-commands")
    assert {row.name for row in stated.machine.rows} == {"shoulder_position", "elbow_position"}
    assert sources(stated)["elbow.command"] == "tau2"
    assert described(tmp_path, motion, MOTORS).reading.kind.test == "inverse dynamics"


def test_torques_without_a_sign_are_not_taken(tmp_path: Path, motion: Columns):
    log = commanded(motion)
    for number in (1, 2):
        coarse = np.round(np.abs(motion[f"dq{number}"]) / 0.5) * 0.5
        log[f"tau{number}"] = coarse
    answer = described(tmp_path, log, SERVOS)
    assert answer.reading.kind.test == "servos"
    assert "a magnitude" in answer.reading.unused["tau1"]
    assert any("magnitudes" in note for note in answer.assumptions)


def test_columns_that_are_not_used_stand_in_the_table(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, {**motion, "status": motion["q1"], "battery": motion["q2"]})
    assert answer.reading.unused["dq1"] == "the test does not need the velocity"
    assert {"status", "battery"} <= set(answer.reading.unused)
    assert "battery" in str(answer)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"elbow__position": "q9"}, "no column 'q9'; there are time, q1"),
        ({"elbo__position": "q2"}, "no joint 'elbo'; did you mean 'elbow'"),
        ({"elbow__place": "q2"}, "'elbow.place' cannot be stated; there are time"),
        ({"elbow__position": "q2 [furlong]"}, "unknown unit"),
        ({"elbow__position": "q2 * q9"}, "no column 'q9'"),
        ({"*__position": "deg"}, r"a unit can be stated, such as \[deg\]"),
        ({"time": "-3"}, "expected a period"),
        ({"test": "pushing"}, "there are inverse dynamics"),
    ],
)
def test_a_correction_that_cannot_be_is_refused_with_what_there_is(
    tmp_path: Path, motion: Columns, stated: dict[str, str], said: str
):
    with pytest.raises(RigtwinError, match=said):
        described(tmp_path, motion, **stated)


def test_a_formula_can_name_any_column(tmp_path: Path, motion: Columns):
    columns = {**motion, "drive.q[2]": math.pi + motion["q2"]}
    del columns["q2"]
    answer = described(tmp_path, columns, elbow__position="drive.q[2] - 3.141592653589793")
    seen = answer.record().column("/sensor", "elbow_position")
    assert seen == pytest.approx(motion["q2"], abs=1e-6)


def test_what_is_written_gives_the_same_machine_and_can_be_edited(tmp_path: Path, motion: Columns):
    answer = described(tmp_path, motion)
    description, mapping = answer.write(tmp_path / "mine")
    assert len([line for line in description.read_text().splitlines() if line[:1] not in "#"]) < 12
    machine = rigtwin.machine(description)
    assert list(machine.components) == list(answer.machine.components)
    recording = rigtwin.import_data(tmp_path / "log.csv", mapping, tmp_path / "log.mcap")
    seen = recording.column("/sensor", "elbow_force")
    assert seen == pytest.approx(answer.record().column("/sensor", "elbow_force"))
    description.write_text(
        description.read_text() + "[components.elbow]\nviscous = { value = 0.3, tolerance = 0.1 }\n"
    )
    edited = rigtwin.machine(description)
    assert edited.plant.elbow.viscous == 0.3
    assert edited.tolerance_of("elbow", "viscous") is not None
    with pytest.raises(RigtwinError, match="exists; choose another folder"):
        answer.write(tmp_path / "mine")


def test_a_log_and_a_model_are_diagnosed_in_one_call(tmp_path: Path, motion: Columns):
    log = write_log(tmp_path / "log.csv", motion)
    answer = rigtwin.diagnose(log, machine=write_arm(tmp_path))
    (effect,) = answer.effects
    assert str(effect.name) == "coulomb@elbow"
    assert effect.parameters["coulomb"].value == pytest.approx(0.5, rel=0.05)
    assert any("rad by its range" in note for note in answer.answer.notes)


def test_the_command_prints_what_was_taken_for_what(
    tmp_path: Path, motion: Columns, capsys: pytest.CaptureFixture[str]
):
    log, model = write_log(tmp_path / "log.csv", motion), write_arm(tmp_path)
    assert main(["describe", str(model), "--log", str(log), "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "elbow.position" in said
    assert (tmp_path / "out" / "two-joints.toml").exists()
    wrong = ["describe", str(model), "--log", str(log), "--column", "elbow"]
    assert main(wrong) == 1
    assert "expected KEY=SOURCE" in capsys.readouterr().err
    assert main(["diagnose", str(log), "--machine", "damper-bench", "--column", "time=t"]) == 1
    assert "--machine arm.xml" in capsys.readouterr().err


SWING = """<mujoco><option timestep="0.0005" integrator="RK4"/><worldbody><body name="rod">
<joint name="pivot" axis="0 1 0" damping="{damping}"/>
<inertial pos="0 0 -0.25" mass="0.5" diaginertia="0.01 0.01 0.001"/></body></worldbody></mujoco>"""


@pytest.mark.slow
def test_joints_of_a_model_without_actuators_swing_freely(tmp_path: Path):
    model = mujoco.MjModel.from_xml_string(SWING.format(damping=0.012))
    data = mujoco.MjData(model)
    data.qpos[:] = 1.2
    rows = []
    for _ in range(1000):
        rows.append([0.01 * len(rows), *data.qpos])
        mujoco.mj_step(model, data, 20)
    noise = 3e-4 * np.random.default_rng(5).standard_normal(len(rows))
    log = tmp_path / "log.csv"
    table = np.array(rows) + np.stack([np.zeros(len(rows)), noise], axis=1)
    np.savetxt(log, table, delimiter=",", header="time,pivot", comments="")
    (tmp_path / "model.xml").write_text(SWING.format(damping=0.001))
    answer = rigtwin.describe(tmp_path / "model.xml", log)
    assert answer.reading.kind.why == "the model has no actuator: the joints swing freely"
    (effect,) = rigtwin.diagnose(log, machine=tmp_path / "model.xml").effects
    assert str(effect.name) == "viscous@pivot"
    assert effect.parameters["viscous"].value == pytest.approx(0.012, rel=0.02)


def test_the_only_column_left_is_the_position_of_the_only_joint(tmp_path: Path):
    text = """<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/>
    <geom type="box" size=".1 .1 .1" mass="2.5"/></body></worldbody>
    <actuator><motor name="push" joint="rail"/></actuator></mujoco>"""
    (tmp_path / "cart.xml").write_text(text)
    time = 0.005 * np.arange(2000)
    x = 0.2 * np.sin(5.0 * time) + 0.1 * np.sin(8.3 * time)
    force = 2.5 * (-0.2 * 25.0 * np.sin(5.0 * time) - 0.1 * 8.3**2 * np.sin(8.3 * time))
    log = tmp_path / "log.csv"
    table = np.stack([time, force, x], axis=1)
    np.savetxt(log, table, delimiter=",", header="t,force,w", comments="")
    answer = rigtwin.describe(tmp_path / "cart.xml", log)
    assert sources(answer)["rail.position"] == "w"
    assert any("the only column left" in line for line in answer.assumptions)


@pytest.mark.parametrize(
    ("stiffness", "named"),
    [(120.0, []), pytest.param(150.0, ["stiffness@rail"], marks=pytest.mark.slow)],
)
def test_a_held_force_half_a_row_early_is_no_gap(tmp_path: Path, stiffness: float, named):
    """A controller holds its force from row to row, and the logged force has no noise."""
    text = """<mujoco><option timestep="0.0005" integrator="implicitfast"/><worldbody>
    <body name="cart"><joint name="rail" type="slide" axis="1 0 0" stiffness="{}" damping="3"/>
    <geom type="box" size=".1 .1 .1" mass="2.5"/></body></worldbody>
    <actuator><motor name="push" joint="rail"/></actuator></mujoco>"""
    (tmp_path / "cart.xml").write_text(text.format(120.0))
    model = mujoco.MjModel.from_xml_string(text.format(stiffness))
    data, random = mujoco.MjData(model), np.random.default_rng(11)
    time = 0.005 * np.arange(3000)
    waves = [
        5.0 * np.sin(2.0 * np.pi * f * time + p) for f, p in ((0.4, 0.3), (1.25, 2.0), (2.2, 4.0))
    ]
    force = np.sum(waves, axis=0)
    rows = []
    for now, push in zip(time, force, strict=True):
        rows.append([now, push, data.qpos[0] + 2e-6 * random.standard_normal()])
        data.ctrl[:] = push
        mujoco.mj_step(model, data, 10)
    log = tmp_path / "log.csv"
    np.savetxt(log, rows, delimiter=",", header="t,force,w", comments="")
    diagnosis = rigtwin.diagnose(log, machine=tmp_path / "cart.xml")
    assert [str(effect.name) for effect in diagnosis.effects] == named
    assert diagnosis.answer.verdict == ("explained" if named else "no gap")


def test_a_column_of_texts_is_no_position(tmp_path: Path):
    text = """<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/>
    <geom type="box" size=".1 .1 .1"/></body></worldbody>
    <actuator><motor name="push" joint="rail"/></actuator></mujoco>"""
    (tmp_path / "cart.xml").write_text(text)
    rows = [f"{0.01 * n:.2f},{math.sin(0.1 * n):.4f},fine" for n in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["t,force,remark", *rows]))
    with pytest.raises(RigtwinError, match="no column is named as the position of rail"):
        rigtwin.describe(tmp_path / "cart.xml", tmp_path / "log.csv")


def test_a_body_named_like_a_rotor_keeps_its_mass(tmp_path: Path):
    model = SWING.format(damping=0.001).replace('name="rod"', 'name="pivot_rotor"')
    (tmp_path / "model.xml").write_text(model)
    time = 0.01 * np.arange(600)
    table = np.stack([time, np.cos(5.0 * time)], axis=1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time,pivot", comments="")
    machine = rigtwin.describe(tmp_path / "model.xml", tmp_path / "log.csv").machine
    names = {str(effect.name) for effect in machine.effects()}
    assert {"mass@pivot_rotor", "armature@pivot_rotor_inertia"} <= names


def test_a_torque_that_cannot_be_read_is_no_free_swing(tmp_path: Path):
    (tmp_path / "model.xml").write_text(SWING.format(damping=0.001))
    rows = [f"{0.01 * n:.2f},{math.cos(0.05 * n):.5f},broken" for n in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["time,pivot,pivot_torque", *rows]))
    with pytest.raises(RigtwinError, match="column 'pivot_torque': it holds 'broken' in line 2"):
        rigtwin.describe(tmp_path / "model.xml", tmp_path / "log.csv")
