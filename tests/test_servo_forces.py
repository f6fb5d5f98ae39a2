"""Logs of servos with their commands and their forces: which of both is judged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

KP, KV, PERIOD, ROWS = 60.0, 2.0, 8e-3, 2000
LEG = """<mujoco><compiler angle="radian"/><worldbody>
<body name="thigh"><joint name="hip" axis="0 1 0" damping="0.1"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.02 0.02"/>
<body name="calf" pos="0 0 -0.2"><joint name="knee" axis="0 1 0" damping="0.1"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.02 0.02"/></body></body></worldbody>
<actuator><position joint="hip" kp="60" kv="2"/><position joint="knee" kp="60" kv="2"/></actuator>
</mujoco>"""
SEAT = """<mujoco><worldbody><body name="table"><joint name="table" type="slide" axis="0 0 1"/>
<inertial pos="0 0 0" mass="50" diaginertia="1 1 1"/><body name="seat" pos="0 0 0.3">
<joint name="suspension" type="slide" axis="0 0 1" stiffness="4000" springref="0.05" damping="90"/>
<inertial pos="0 0 0" mass="20" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><position name="shaker" joint="table" kp="3e5" kv="9e3"/></actuator></mujoco>"""


def motion(seed: int) -> tuple[Array, Array, Array]:
    """Time, and angles and speeds of both joints, shape (2, rows)."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(ROWS)
    rates, phases = random.uniform(1.0, 7.0, (2, 3)), random.uniform(0.0, 6.0, (2, 3))
    waves = rates[:, :, None] * time + phases[:, :, None]
    return time, 0.2 * np.sin(waves).sum(1), 0.2 * (rates[:, :, None] * np.cos(waves)).sum(1)


def kind(folder: Path, held: int, scale: float = 1.0, constant: float = 0.0) -> str:
    """Kind of the test of a log whose forces use the command of `held` rows before."""
    random = np.random.default_rng(held)
    time, angles, speeds = motion(5)
    commands = angles + 0.05 * np.sin(3.0 * time + np.array([[0.0], [1.0]]))
    forces = KP * (np.roll(commands, held, axis=1) - angles) - KV * speeds
    forces = scale * forces + constant + 0.01 * random.standard_normal(forces.shape)
    columns = {"time": time}
    for joint, command, angle, force in zip(("hip", "knee"), commands, angles, forces, strict=True):
        columns |= {f"{joint}_cmd": command, f"{joint}_pos": angle, f"{joint}_torque": force}
    (folder / "leg.xml").write_text(LEG)
    log = write_log(folder / "log.csv", columns)
    return rigtwin.describe(folder / "leg.xml", log).reading.kind.test


@pytest.mark.parametrize("held", [0, 1])
def test_forces_of_the_models_servos_leave_the_commands_to_judge(tmp_path: Path, held: int) -> None:
    assert kind(tmp_path, held) == "servos"


@pytest.mark.parametrize(("scale", "constant"), [(1.15, 0.0), (1.0, 0.8), (0.6, 0.0)])
def test_forces_that_a_sensor_reads_otherwise_are_judged(
    tmp_path: Path, scale: float, constant: float
) -> None:
    assert kind(tmp_path, 0, scale, constant) == "inverse dynamics"


def test_forces_of_another_law_are_judged(tmp_path: Path) -> None:
    assert kind(tmp_path, 40) == "inverse dynamics"


def test_a_servo_may_shake_what_no_actuator_moves(tmp_path: Path) -> None:
    (tmp_path / "seat.xml").write_text(SEAT)
    time, (table, travel), _ = motion(6)
    columns = {"time": time, "table_cmd": table, "table_pos": table, "susp_travel_m": travel}
    described = rigtwin.describe(tmp_path / "seat.xml", write_log(tmp_path / "log.csv", columns))
    assert described.reading.kind.test == "servos"
    (replay,) = described.machine.replays
    assert set(replay.free) == {"table", "suspension"}
    assert replay.moved_by == ("shaker",)


@pytest.mark.parametrize(("gravity", "tilts"), [("0 0 -9.81", {"x", "y"}), ("0 0 0", set())])
def test_the_base_of_coupled_joints_may_be_off_level(
    tmp_path: Path, gravity: str, tilts: set[str]
) -> None:
    model = LEG.replace("<worldbody>", f'<option gravity="{gravity}"/><worldbody>')
    (tmp_path / "leg.xml").write_text(model)
    time, angles, _ = motion(7)
    names = ("hip_torque", "knee_torque", "hip_pos", "knee_pos")
    columns = {"time": time, **dict(zip(names, (*angles, *angles), strict=True))}
    described = rigtwin.describe(tmp_path / "leg.xml", write_log(tmp_path / "log.csv", columns))
    names = {effect.kind.name for effect in described.machine.effects() if effect.group == "base"}
    assert names == {f"tilt_{axis}" for axis in tilts}


SHAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="motor">
<joint name="motor" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
</body><body name="load"><joint name="load" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody>
<tendon><fixed name="shaft" stiffness="20"><joint joint="load" coef="1"/>
<joint joint="motor" coef="-1"/></fixed></tendon>
<actuator><motor name="drive" joint="motor"/></actuator></mujoco>"""


def test_the_spring_between_two_joints_may_be_another(tmp_path: Path) -> None:
    (tmp_path / "shaft.xml").write_text(SHAFT)
    time, (motor, load), _ = motion(8)
    columns = {"time": time, "drive_cmd": motor, "motor_pos": motor, "load_pos": load}
    described = rigtwin.describe(tmp_path / "shaft.xml", write_log(tmp_path / "log.csv", columns))
    assert described.reading.kind.test == "inverse dynamics"
    names = {effect.kind.name for effect in described.machine.effects() if effect.group == "shaft"}
    assert names == {"coulomb", "viscous", "stiffness", "cubic_stiffness", "slack"}


FLOOR = """[machine]
name = "leg"
model = "leg.xml"
[components.floor]
body = "world"
type = "base"
effects = ["tilt_y"]
[[replays]]
test = "inverse dynamics"
"""


def test_a_described_base_takes_the_place_of_the_implied_one(tmp_path: Path) -> None:
    (tmp_path / "leg.xml").write_text(LEG)
    (tmp_path / "leg.toml").write_text(FLOOR)
    machine = rigtwin.machine(tmp_path / "leg.toml")
    tilts = [effect for effect in machine.effects() if effect.kind.name.startswith("tilt")]
    assert [(effect.group, effect.kind.name) for effect in tilts] == [("floor", "tilt_y")]


def test_forces_that_the_owner_states_are_judged(tmp_path: Path) -> None:
    assert kind(tmp_path, 0) == "servos"
    columns = {f"{joint}.force": f"{joint}_torque" for joint in ("hip", "knee")}
    described = rigtwin.describe(tmp_path / "leg.xml", tmp_path / "log.csv", columns=columns)
    assert described.reading.kind.test == "inverse dynamics"
