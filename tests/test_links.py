"""From a model and a log alone: what the links weigh, and what the last one holds."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.description.document import load

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 -1 0" damping="0.5" armature="0.02"/>
<inertial pos="0 0 -0.15" mass="1.2" diaginertia="0.012 0.012 0.001"/>
<body name="fore" pos="0 0 -0.3">
<joint name="elbow" axis="0 -1 0" damping="0.3" armature="0.01"/>
<inertial pos="0 0 -0.12" mass="0.8" diaginertia="0.006 0.006 0.0005"/>
LOAD</body></body></worldbody>
<actuator><position name="m1" joint="shoulder" kp="120" kv="6"/>
<position name="m2" joint="elbow" kp="80" kv="4"/></actuator>
<sensor><jointpos name="q1" joint="shoulder"/><jointpos name="q2" joint="elbow"/>SENSORS</sensor>
</mujoco>"""
LOAD = """<body pos="0 0 -0.24">
<inertial pos="0 0 0" mass="0.5" diaginertia="2e-4 2e-4 2e-4"/></body>"""
BULKY = """<body pos="0 0 -0.15">
<inertial pos="0 0 0" mass="2.5" diaginertia="0.08 0.08 0.08"/></body>"""
TORQUES = """<jointactuatorfrc name="tau1" joint="shoulder"/>
<jointactuatorfrc name="tau2" joint="elbow"/>"""


def model(load: str = "", sensors: str = "") -> str:
    return ARM.replace("LOAD", load).replace("SENSORS", sensors)


def write(path: Path, names: str, rows: np.ndarray) -> Path:
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.8g")
    return path


def swing(seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and smooth commands of both servos, rad, from a seed."""
    random = np.random.default_rng(seed)
    time = np.arange(round(100 * seconds)) / 100
    rates, phases = random.uniform(0.2, 2.0, (2, 5)), random.uniform(0.0, 6.28, (2, 5))
    waves = [
        sum(
            0.2 * np.sin(2 * np.pi * rate * time + phase) for rate, phase in zip(*both, strict=True)
        )
        for both in zip(rates, phases, strict=True)
    ]
    commands = np.stack(waves)
    return time, commands - commands[:, :1]


@pytest.mark.parametrize("test", ["inverse dynamics", "servos"])
def test_the_links_are_bodies_of_a_described_arm(tmp_path: Path, test: str):
    (tmp_path / "arm.xml").write_text(model(sensors=TORQUES))
    path = tmp_path / "arm.toml"
    path.write_text(f'[machine]\nname = "arm"\nmodel = "arm.xml"\n\n[[replays]]\ntest = "{test}"\n')
    machine = load(path)
    # Along the joint's own axis, y, a centre of mass may be anywhere.
    measured = {"inertia"} if test == "inverse dynamics" else {"lever_x", "lever_z"}
    assert machine.components["fore"].kinds == {"mass", "payload"} | measured
    assert machine.components["upper"].kinds == {"mass"}


@pytest.mark.slow
def test_a_payload_is_found_from_the_commands_of_servos(tmp_path: Path):
    (tmp_path / "arm.xml").write_text(model())
    held = mujoco.MjModel.from_xml_string(model(LOAD))
    state, random = mujoco.MjData(held), np.random.default_rng(3)
    time, commands = swing(8.0, 1)
    rows = []
    for now, command in zip(time, commands.T, strict=True):
        rows.append([now, *command, *(state.qpos + 1e-4 * random.standard_normal(2))])
        state.ctrl[:] = command
        for _ in range(10):
            mujoco.mj_step(held, state)
    log = write(tmp_path / "log.csv", "time,m1_cmd,m2_cmd,q1,q2", np.array(rows))
    (payload,) = rigtwin.diagnose(log, machine=tmp_path / "arm.xml").effects
    assert str(payload.name) == "payload@fore"
    assert payload.parameters["payload"].value == pytest.approx(0.5, rel=0.03)
    assert payload.parameters["payload_z"].value == pytest.approx(-0.24, rel=0.03)


def diagnose_torques(folder: Path, load: str) -> rigtwin.Diagnosis:
    """Diagnose the torques of a measured motion with friction, under a load on the last link."""
    (folder / "arm.xml").write_text(model(sensors=TORQUES))
    heavy = mujoco.MjModel.from_xml_string(model(load))
    state, random = mujoco.MjData(heavy), np.random.default_rng(4)
    time, motion = swing(8.0, 2)
    speed = np.gradient(motion, time, axis=1)
    acceleration = np.gradient(speed, time, axis=1)
    torques = np.zeros_like(motion)
    for tick in range(len(time)):
        state.qpos[:], state.qvel[:] = motion[:, tick], speed[:, tick]
        state.qacc[:] = acceleration[:, tick]
        mujoco.mj_inverse(heavy, state)
        torques[:, tick] = state.qfrc_inverse + [0.6, 0.3] * np.sign(speed[:, tick])
    torques += 0.01 * random.standard_normal(torques.shape)
    rows = np.column_stack([time, motion.T, torques.T])
    log = write(folder / "log.csv", "time [s],q1 [rad],q2 [rad],tau1 [Nm],tau2 [Nm]", rows)
    return rigtwin.diagnose(log, machine=folder / "arm.xml")


@pytest.mark.slow
def test_a_heavy_link_and_friction_are_found_from_torques(tmp_path: Path):
    answer = diagnose_torques(tmp_path, LOAD)
    found = {str(e.name): next(iter(e.parameters.values())).value for e in answer.effects}
    assert found["coulomb@shoulder"] == pytest.approx(0.6, rel=0.05)
    assert found["coulomb@elbow"] == pytest.approx(0.3, rel=0.05)
    assert found["payload@fore"] == pytest.approx(0.5, rel=0.1)


@pytest.mark.slow
def test_a_load_with_an_inertia_of_its_own_needs_no_effect_at_another_joint(tmp_path: Path):
    answer = diagnose_torques(tmp_path, BULKY)
    names = {str(effect.name) for effect in answer.effects}
    assert names == {"coulomb@shoulder", "coulomb@elbow", "payload@fore", "inertia@fore"}
    # The motion shows the mass, first moment and moment of inertia of link and load together.
    fore = answer.corrected.plant.fore
    assert fore.payload == pytest.approx(2.5, rel=0.01)
    assert fore.payload_z == pytest.approx(-0.15, rel=0.01)
    inertia = fore.inertia * 0.006 + fore.payload * fore.payload_z**2
    assert inertia == pytest.approx(0.006 + 0.08 + 2.5 * 0.15**2, rel=0.01)
