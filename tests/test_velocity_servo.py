"""Velocity servos: their law, and their motion beside MuJoCo's own actuators."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.components import VelocityServo, component_of
from rigtwin.components.servo import push, push_law
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

MODEL = """<mujoco><option gravity="0 0 -9.81" timestep="1e-4" integrator="implicitfast"/>
<worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.05"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.6"/>{forearm}</body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""
FOREARM = """<body name="lower" pos="0 0 -0.3"><joint name="elbow" axis="0 1 0" damping="0.03"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.3"/></body>"""
SHOULDER = """<velocity name="shoulder_drive" joint="shoulder" kv="4"
forcerange="-{limit} {limit}"/>"""
ELBOW = '<velocity name="elbow_drive" joint="elbow" kv="2" gear="1.5"/>'
DC_MOTOR = (
    '<dcmotor name="shoulder_drive" joint="shoulder" gear="3" motorconst="0.5" resistance="4"/>'
)
TABLES = """[machine]
name = "arm"
model = "arm.xml"
[[replays]]
test = "force commands"
"""
PERIOD, TICKS = 2e-3, 1500


def write_machine(folder: Path, *actuators: str) -> rigtwin.Machine:
    """Machine of one joint for each actuator."""
    forearm = FOREARM if len(actuators) > 1 else ""
    text = MODEL.format(forearm=forearm, actuators="".join(actuators))
    (folder / "arm.xml").write_text(text)
    (folder / "arm.toml").write_text(TABLES)
    return rigtwin.machine(folder / "arm.toml")


def drive(path: Path) -> RecordedTest:
    """Recording of MuJoCo's own actuators."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, time = mujoco.MjData(model), PERIOD * np.arange(TICKS)
    commands = np.stack([2.0 * np.sin(3.1 * time), np.sign(np.sin(5.3 * time))])[: model.nu]
    positions = np.zeros_like(commands)
    for tick in range(TICKS):
        positions[:, tick], data.ctrl[:] = data.qpos, commands[:, tick]
        mujoco.mj_step(model, data, round(PERIOD / model.opt.timestep))
    names = ("shoulder", "elbow")[: model.nu]
    columns = {
        "/command": {f"{n}_drive": row for n, row in zip(names, commands, strict=True)},
        "/sensor": {f"{n}_position": row for n, row in zip(names, positions, strict=True)},
    }
    return RecordedTest(Path("arm"), "arm", "", PERIOD, time, columns, {})


def predict(machine: rigtwin.Machine, recording: RecordedTest) -> Array:
    configuration = machine.configuration_of(recording)
    model = machine.physics.model(machine, recording.inputs, configuration, 16)
    return model.predict(machine.plant)


def test_it_pushes_by_its_command_less_its_damping_up_to_its_limit() -> None:
    law = push_law(VelocityServo(velocity_gain=3.0, damping_gain=2.0, force_limit=5.0, gains=0.5))
    assert push(law, 1.5, 100.0, 0.4) == pytest.approx(0.5 * (3.0 * 1.5 - 2.0 * 0.4))
    assert push(law, 20.0, 0.0, 0.0) == 5.0
    assert push(law, -20.0, 0.0, 0.0) == -5.0


@pytest.mark.parametrize("limit", [100.0, 1.0], ids=["free", "limited"])
@pytest.mark.parametrize("more", [(), (ELBOW,)], ids=["alone", "coupled"])
def test_the_prediction_is_that_of_mujocos_velocity_actuators(
    tmp_path: Path, more: tuple[str, ...], limit: float
) -> None:
    machine = write_machine(tmp_path, SHOULDER.format(limit=limit), *more)
    recording = drive(tmp_path / "arm.xml")
    for name, predicted in zip(("shoulder", "elbow"), predict(machine, recording), strict=False):
        measured = recording[f"/sensor.{name}_position"]
        assert np.sqrt(np.mean((predicted - measured) ** 2)) < 0.002 * np.std(measured)


def test_a_dc_motor_is_a_velocity_servo_by_its_back_emf(tmp_path: Path) -> None:
    machine = write_machine(tmp_path, DC_MOTOR)
    servo = component_of(machine.plant, "shoulder_drive", VelocityServo)
    # gear·K/R per volt, and (gear·K)²/R per rad/s.
    assert (servo.velocity_gain, servo.damping_gain) == (3 * 0.5 / 4, (3 * 0.5) ** 2 / 4)
    recording = drive(tmp_path / "arm.xml")
    measured = recording["/sensor.shoulder_position"]
    (predicted,) = predict(machine, recording)
    assert np.sqrt(np.mean((predicted - measured) ** 2)) < 0.002 * np.std(measured)


def test_friction_of_a_joint_that_a_velocity_servo_drives_is_found(tmp_path: Path) -> None:
    machine = write_machine(tmp_path, SHOULDER.format(limit=100.0))
    rough = tmp_path / "rough.xml"
    text = (tmp_path / "arm.xml").read_text()
    rough.write_text(text.replace('damping="0.05"', 'damping="0.85"'))
    answer = rigtwin.diagnose(drive(rough), machine=machine)
    (finding,) = answer.effects
    assert str(finding.name) == "viscous@shoulder"
    assert finding.parameters["viscous"].value == pytest.approx(0.85, rel=0.02)


def test_the_corrected_mjcf_has_both_gains_and_the_limit(tmp_path: Path) -> None:
    machine = write_machine(tmp_path, SHOULDER.format(limit=100.0))
    values = {"gains": 1.5, "force_limit": 7.0}
    changes = [Change("shoulder_drive", name, value) for name, value in values.items()]
    assert write_mjcf(tmp_path / "new.xml", machine, changes) == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert model.actuator_gainprm[0, 0] == 6.0
    assert model.actuator_biasprm[0, 2] == -6.0
    assert model.actuator_forcerange[0].tolist() == [-7.0, 7.0]
