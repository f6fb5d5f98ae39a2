"""Logs of force commands whose motion no simulation follows: judged by the forces along it."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.describing.described import Described
from rigtwin.describing.other_view import VIEWS, describe_otherwise
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

CARRIAGE = """<mujoco><option gravity="0 0 0"/><worldbody><body name="carriage">
<joint name="axis" type="slide" axis="1 0 0" damping="{damping}"/>
<inertial pos="0 0 0" mass="4" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor name="coil" joint="axis" gear="{gear}"/></actuator></mujoco>"""
MASS, DAMPING, COGGING, PITCH, PHASE = 4.0, 8.0, 11.0, 0.031, 0.5
PERIOD, ROWS, STEPS = 4e-3, 2500, 20


def follow(cogging: float, seed: int) -> dict[str, Array]:
    """Time, force and position of a carriage that a controller moves over its magnets."""
    random = np.random.default_rng(seed)
    phases = random.uniform(0.0, 6.0, 3)
    time, forces, positions = PERIOD * np.arange(ROWS), np.zeros(ROWS), np.zeros(ROWS)
    x = v = 0.0
    for row in range(ROWS):
        waves = (math.sin(w * time[row] + p) for w, p in zip((1.3, 2.9, 5.1), phases, strict=True))
        wanted = 0.06 * sum(waves) * min(time[row], 1.0)
        force = 4000.0 * (wanted - x) - 200.0 * v
        forces[row], positions[row] = force, x
        # The force is held until the next row.
        for _ in range(STEPS):
            wave = cogging * math.sin(2.0 * math.pi * x / PITCH + PHASE)
            v += PERIOD / STEPS / MASS * (force - DAMPING * v - wave)
            x += PERIOD / STEPS * v
    return {"t": time, "F": forces, "x": positions + 2e-5 * random.standard_normal(ROWS)}


def describe(folder: Path, log: dict[str, Array], gear: float = 1.0, test: str = "") -> Described:
    model = folder / "axis.xml"
    model.write_text(CARRIAGE.format(damping=DAMPING, gear=gear))
    log = {"t": log["t"], "axis_cmd": log["F"] / gear, "axis_pos": log["x"]}
    return rigtwin.describe(model, write_log(folder / "log.csv", log), test=test)


@pytest.mark.slow
def test_cogging_that_no_simulation_follows_is_found_along_the_motion(tmp_path: Path) -> None:
    described = describe(tmp_path, follow(COGGING, 5))
    assert described.reading.kind.test == "force commands"
    answer = rigtwin.diagnose(tmp_path / "log.csv", machine=tmp_path / "axis.xml")
    # Smoothing the motion takes a little of the cogging away, which may stand out of the noise.
    assert answer.verdict in ("explained", "partly explained")
    assert answer.gap is not None
    assert answer.gap.shrinkage_held_out.value > 0.95
    (finding,) = answer.effects
    assert str(finding.name) == "cogging@axis"
    assert finding.parameters["cogging"].value == pytest.approx(COGGING, rel=0.05)
    assert finding.parameters["cogging_pitch"].value == pytest.approx(PITCH, rel=0.01)
    assert "judged by the forces along the measured motion" in answer.answer.notes[0]


@pytest.mark.parametrize("gear", [1.0, 2.5])
def test_the_command_times_its_gear_is_the_force(tmp_path: Path, gear: float) -> None:
    log = follow(0.0, 6)
    described = describe(tmp_path, log, gear)
    (view,) = VIEWS[described.reading.kind.test]
    seen = describe_otherwise(described, view)
    assert seen is not None
    force = seen.record()["/sensor.axis_force"]
    assert force == pytest.approx(log["F"], abs=1e-5 * np.max(np.abs(log["F"])))


def test_what_its_owner_stated_has_no_other_view(tmp_path: Path) -> None:
    described = describe(tmp_path, follow(0.0, 7), test="force commands")
    assert describe_otherwise(described, VIEWS[described.reading.kind.test][0]) is None


ROD = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="rod">
<joint name="pivot" axis="0 1 0" damping="0.05"/>
<inertial pos="0 0 -0.2" mass="0.6" diaginertia="0.004 0.004 0.004"/></body></worldbody>
<actuator><motor name="drive" joint="pivot"/></actuator></mujoco>"""
INERTIA, GRAVITY = 0.004 + 0.6 * 0.2**2, 0.6 * 9.81 * 0.2


def swing(limit: float, damping: float) -> dict[str, Array]:
    """Time, commanded torque and angle of a damped rod whose drive gives no more than `limit`."""
    random = np.random.default_rng(8)
    time, angles = PERIOD * np.arange(ROWS), np.zeros(ROWS)
    torques = 0.5 * np.sin(2.1 * time) + 0.3 * np.sin(4.7 * time + 1.0)
    q = v = 0.0
    for row in range(ROWS):
        angles[row], given = q, min(max(torques[row], -limit), limit)
        for _ in range(STEPS):
            v += PERIOD / STEPS / INERTIA * (given - damping * v - GRAVITY * math.sin(q))
            q += PERIOD / STEPS * v
    return {"t": time, "tau": torques, "q": angles + 1e-4 * random.standard_normal(ROWS)}


@pytest.mark.slow
def test_a_torque_that_the_drive_did_not_give_is_judged_as_a_command(tmp_path: Path) -> None:
    model = tmp_path / "rod.xml"
    model.write_text(ROD)
    log = write_log(tmp_path / "log.csv", swing(0.45, 0.07))
    assert rigtwin.describe(model, log).reading.kind.test == "inverse dynamics"
    answer = rigtwin.diagnose(log, machine=model)
    assert answer.verdict == "explained"
    findings = {str(finding.name): finding.parameters for finding in answer.effects}
    assert set(findings) == {"saturation@drive", "viscous@pivot"}
    assert findings["saturation@drive"]["saturation"].value == pytest.approx(0.45, rel=0.03)
    assert findings["viscous@pivot"]["viscous"].value == pytest.approx(0.07, rel=0.03)
    assert "taken as commands" in answer.answer.notes[0]


def test_forces_of_joints_without_actuators_are_no_commands(tmp_path: Path) -> None:
    model = tmp_path / "rod.xml"
    model.write_text(ROD.replace('<motor name="drive" joint="pivot"/>', ""))
    described = rigtwin.describe(model, write_log(tmp_path / "log.csv", swing(0.45, 0.07)))
    assert described.reading.kind.test == "inverse dynamics"
    assert all(describe_otherwise(described, view) is None for view in VIEWS["inverse dynamics"])


SERVO = """<mujoco><option timestep="0.001"/><worldbody><body name="link">
<joint name="pivot" axis="0 1 0" damping="0.1" armature="0.02" {friction}/>
<inertial pos="0 0 -0.2" mass="0.6" diaginertia="0.01 0.01 0.001"/></body></worldbody>
<actuator><position name="servo" joint="pivot" kp="40" kv="2"/></actuator></mujoco>"""
ROW, FRICTION = 0.01, 0.15


def serve(friction: str, seed: int) -> dict[str, Array]:
    """Time, set point and angle of a servo, read at the end of the row that a set point acts in."""
    random = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string(SERVO.format(friction=friction))
    data, time = mujoco.MjData(model), ROW * np.arange(1000)
    rates, phases = random.uniform(0.5, 5.0, (2, 4))
    waves = 0.25 * np.sin(rates[:, None] * time + phases[:, None]).sum(0)
    commands, angles = waves - waves[0], np.zeros(len(time))
    for row, command in enumerate(commands):
        data.ctrl[0] = command
        for _ in range(round(ROW / model.opt.timestep)):
            mujoco.mj_step(model, data)
        angles[row] = data.qpos[0]
    return {"t": time, "cmd": commands, "pos": angles + 1e-4 * random.standard_normal(len(time))}


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["", f'frictionloss="{FRICTION}"'])
def test_rows_may_hold_the_state_after_their_command(tmp_path: Path, friction: str) -> None:
    model = tmp_path / "servo.xml"
    model.write_text(SERVO.format(friction=""))
    fitted, held_out = (
        write_log(tmp_path / f"{seed}.csv", serve(friction, seed)) for seed in (1, 2)
    )
    answer = rigtwin.diagnose(fitted, machine=model, held_out=held_out)
    assert "the state after its command" in answer.answer.notes[0]
    assert [str(effect.name) for effect in answer.effects] == ["coulomb@pivot"] * bool(friction)
    for effect in answer.effects:
        assert effect.parameters["coulomb"].value == pytest.approx(FRICTION, rel=0.05)
    assert answer.verdict == ("explained" if friction else "no gap")


SAGGING = """<mujoco><option timestep="0.0005"/><worldbody><body name="arm">
<joint name="hinge" axis="0 -1 0"{friction}/>
<inertial pos="0 0 -0.1" mass="0.5" diaginertia="1e-5 1e-5 1e-5"/></body></worldbody>
<actuator><position name="servo" joint="hinge" kp="0.8"/></actuator></mujoco>"""


@pytest.mark.slow
def test_a_servo_that_gives_way_is_judged_as_one_although_its_damping_is_unknown(
    tmp_path: Path,
) -> None:
    machine = mujoco.MjModel.from_xml_string(SAGGING.format(friction=' damping="0.06"'))
    data, random = mujoco.MjData(machine), np.random.default_rng(7)
    time, positions = 0.005 * np.arange(2000), np.zeros(2000)
    goals = 1.2 * np.sin(0.15 * time**2)
    for row, goal in enumerate(goals):
        positions[row], data.ctrl[0] = data.qpos[0], goal
        mujoco.mj_step(machine, data, 10)
    model = tmp_path / "servo.xml"
    model.write_text(SAGGING.format(friction=""))
    noise = 5e-4 * random.standard_normal(len(time))
    log = write_log(tmp_path / "log.csv", {"t": time, "goal": goals, "angle": positions + noise})
    assert rigtwin.describe(model, log).reading.kind.test == "position commands"
    answer = rigtwin.diagnose(log, machine=model)
    assert any("judged as servos" in note for note in answer.answer.notes)
    (finding,) = answer.effects
    assert str(finding.name) == "viscous@hinge"
    assert finding.parameters["viscous"].value == pytest.approx(0.06, rel=0.03)


def test_a_supply_is_no_command_of_a_position(tmp_path: Path) -> None:
    model = tmp_path / "servo.xml"
    model.write_text(SAGGING.format(friction=' damping="0.06"'))
    time = 0.01 * np.arange(400)
    goal = np.sin(time)
    log = {"t": time, "position": goal, "goal_position": goal, "input_volts": 7.0 + 0.01 * goal}
    described = rigtwin.describe(model, write_log(tmp_path / "log.csv", log))
    assert "a voltage" in described.reading.unused["input_volts"]
