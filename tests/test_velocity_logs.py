"""Logs of velocities in place of positions, and commands that are velocities or voltages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.described import Described
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

SHAFT = """<mujoco><compiler angle="radian"/><option gravity="0 0 {gravity}"/><worldbody>
<body name="rotor"><joint name="shaft" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator>{actuator}</actuator></mujoco>"""
MOTOR = '<motor name="motor" joint="shaft"/>'
VELOCITY = '<velocity name="drive" joint="shaft" kv="0.5"/>'
DC_MOTOR = '<dcmotor name="drive" joint="shaft" motorconst="0.05" resistance="2"/>'
PERIOD, ROWS, INERTIA, VISCOUS = 5e-3, 2400, 0.02, 0.05


def write_shaft(folder: Path, actuator: str = MOTOR, gravity: float = 0.0) -> Path:
    path = folder / "shaft.xml"
    path.write_text(SHAFT.format(actuator=actuator, gravity=gravity))
    return path


def turn(gain: float, damping: float) -> dict[str, Array]:
    """Time, held command and velocity of a shaft: J·dω/dt = gain·u − damping·ω, exactly."""
    time = PERIOD * np.arange(ROWS)
    command = 2.0 * np.sin(1.7 * time) + np.sin(4.1 * time)
    velocity, share = np.zeros(ROWS), np.exp(-damping * PERIOD / INERTIA)
    for row in range(ROWS - 1):
        end = gain * command[row] / damping
        velocity[row + 1] = end + (velocity[row] - end) * share
    noise = 1e-3 * np.random.default_rng(4).standard_normal(ROWS)
    return {"t": time, "command": command, "velocity": velocity + noise}


def described(folder: Path, model: Path, columns: dict[str, Array], **stated: str) -> Described:
    named = {key.replace("_", ".", 1): text for key, text in stated.items()}
    return rigtwin.describe(model, write_log(folder / "log.csv", columns), columns=named)


def test_torque_and_speed_alone_show_the_friction(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    rpm = 30.0 / np.pi * motion["velocity"]
    columns = {"t": motion["t"], "torque_Nm": motion["command"], "speed_rpm": rpm}
    log = write_log(tmp_path / "log.csv", columns)
    answer = rigtwin.diagnose(log, machine=write_shaft(tmp_path))
    (finding,) = answer.effects
    assert str(finding.name) == "viscous@shaft"
    assert finding.parameters["viscous"].value == pytest.approx(VISCOUS, rel=0.02)


def test_the_written_description_states_the_velocities(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    columns = {"t": motion["t"], "torque": motion["command"], "omega": motion["velocity"]}
    answer = described(tmp_path, write_shaft(tmp_path), columns)
    assert 'velocities = ["shaft"]' in answer.description
    assert '"/sensor.shaft_velocity"' in answer.mapping
    assert answer.reading.kind.test == "force commands"


@pytest.mark.parametrize(
    ("actuator", "name", "factor", "unit"),
    [
        (VELOCITY, "cmd_vel", 1.0, "rad/s"),
        (VELOCITY, "vel_setpoint", 180.0 / np.pi, "deg/s"),
        (VELOCITY, "target_speed_rpm", 30.0 / np.pi, "rpm"),
        (DC_MOTOR, "motor_voltage", 1.0, "1"),
    ],
)
def test_a_command_is_taken_as_the_actuator_takes_it(
    tmp_path: Path, actuator: str, name: str, factor: float, unit: str
) -> None:
    motion = turn(0.5, 0.55)
    columns = {"t": motion["t"], name: factor * motion["command"], "omega": motion["velocity"]}
    answer = described(tmp_path, write_shaft(tmp_path, actuator), columns)
    (command,) = (s for s in answer.reading.signals if s.key == "shaft.command")
    assert (command.column, command.unit, command.sign) == (name, unit, 1.0)


def test_a_velocity_command_against_the_motion_is_turned(tmp_path: Path) -> None:
    motion = turn(-0.5, 0.55)
    columns = {"t": motion["t"], "cmd_vel": motion["command"], "omega": motion["velocity"]}
    answer = described(tmp_path, write_shaft(tmp_path, VELOCITY), columns)
    (command,) = (s for s in answer.reading.signals if s.key == "shaft.command")
    assert command.sign == -1.0


def test_a_fast_velocity_without_a_unit_is_a_question(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    columns = {"t": motion["t"], "torque": motion["command"], "speed": 10.0 * motion["velocity"]}
    with pytest.raises(RigtwinError, match="in what unit is it"):
        described(tmp_path, write_shaft(tmp_path), columns)
    answer = described(tmp_path, write_shaft(tmp_path), columns, shaft_velocity="speed [rpm]")
    (velocity,) = (s for s in answer.reading.signals if s.key == "shaft.velocity")
    assert velocity.unit == "rpm"


def test_a_velocity_does_not_suffice_under_gravity(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    columns = {"t": motion["t"], "torque": motion["command"], "omega": motion["velocity"]}
    with pytest.raises(RigtwinError, match="a velocity does not suffice"):
        described(tmp_path, write_shaft(tmp_path, gravity=-9.81), columns)
    answer = described(
        tmp_path,
        write_shaft(tmp_path, gravity=-9.81),
        columns,
        shaft_position="integral(omega)",
        shaft_force="torque",
    )
    assert answer.reading.velocities == ()


@pytest.mark.parametrize(
    ("test", "velocities", "said"),
    [
        ("inverse dynamics", '["shaft"]', "with test = 'inverse dynamics' positions are measured"),
        ("force commands", '["axle"]', "expected a list of joints"),
        ("force commands", "1", "expected a list of joints"),
    ],
)
def test_velocities_of_no_such_test_or_joint_are_refused(
    tmp_path: Path, test: str, velocities: str, said: str
) -> None:
    write_shaft(tmp_path)
    path = tmp_path / "shaft.toml"
    path.write_text(
        f'[machine]\nname = "shaft"\nmodel = "shaft.xml"\n'
        f'[[replays]]\ntest = "{test}"\nvelocities = {velocities}\n'
    )
    with pytest.raises(RigtwinError, match=said):
        rigtwin.machine(path)


def test_a_short_log_suffices_for_the_unit_of_a_velocity_command(tmp_path: Path) -> None:
    time = 1e-3 * np.arange(50)
    columns = {"t": time, "cmd_vel": np.cos(60.0 * time), "angle": np.sin(60.0 * time) / 60.0}
    answer = described(tmp_path, write_shaft(tmp_path, VELOCITY), columns)
    (command,) = (s for s in answer.reading.signals if s.key == "shaft.command")
    assert (command.unit, command.sign) == ("rad/s", 1.0)


def test_a_velocity_without_a_number_is_one_line(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    columns = {"t": motion["t"], "torque": motion["command"], "omega": np.full(ROWS, np.nan)}
    with pytest.raises(RigtwinError, match="the velocity of joint shaft, holds no number"):
        described(tmp_path, write_shaft(tmp_path), columns)


def test_a_measured_torque_is_no_command_of_a_voltage(tmp_path: Path) -> None:
    motion = turn(1.0, VISCOUS)
    columns = {"t": motion["t"], "torque": motion["command"], "omega": motion["velocity"]}
    said = "no column is the command of the actuator on shaft, .* say --column shaft.command=COLUMN"
    with pytest.raises(RigtwinError, match=said):
        described(tmp_path, write_shaft(tmp_path, DC_MOTOR), columns)


def test_a_velocity_that_is_text_is_named_with_its_reason(tmp_path: Path) -> None:
    rows = "".join(f"{0.004 * row},{np.sin(0.02 * row)},fast\n" for row in range(100))
    log = tmp_path / "log.csv"
    log.write_text(f"t,torque,omega\n{rows}")
    with pytest.raises(RigtwinError, match="column 'omega': "):
        rigtwin.describe(write_shaft(tmp_path), log)
