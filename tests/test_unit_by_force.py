"""Units told by forces, times without a telling name, one signal in two units, closed loops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components.actuators import ForceActuator
from rigtwin.components.plant import component_of
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

SHAFT = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body name="rotor">
<joint name="shaft" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body></worldbody>
<actuator><motor name="motor" joint="shaft" gear="{gear}"/></actuator></mujoco>"""
LOOP = """<mujoco><worldbody>
<body name="crank"><joint name="a" axis="0 1 0"/><geom size="0.1"/></body>
<body name="rocker" pos="0.2 0 0"><joint name="b" axis="0 1 0"/><geom size="0.1"/></body>
</worldbody>
<equality><connect body1="crank" body2="rocker" anchor="0.1 0 0"/></equality></mujoco>"""
PERIOD, ROWS, INERTIA = 2e-3, 4000, 0.02


def write_shaft(folder: Path, gear: float = 1.0) -> Path:
    path = folder / "shaft.xml"
    path.write_text(SHAFT.format(gear=gear))
    return path


def shaft_motion(drift: float = 0.0) -> dict[str, Array]:
    """Motion of the shaft, turning on and on with `drift` in rad/s, and its torque."""
    time = PERIOD * np.arange(ROWS)
    angle = drift * time + 0.4 * np.sin(9.0 * time) + 0.1 * np.sin(31.0 * time)
    torque = -INERTIA * (0.4 * 81.0 * np.sin(9.0 * time) + 0.1 * 961.0 * np.sin(31.0 * time))
    return {"time": time, "angle": angle, "torque": torque}


@pytest.mark.parametrize(
    ("unit", "drift"), [("deg", 0.0), ("rad", 3.0), ("deg", 3.0), ("rad", 400.0)]
)
def test_forces_tell_rad_from_degrees(tmp_path: Path, unit: str, drift: float):
    motion = shaft_motion(drift)
    if unit == "deg":
        motion["angle"] = np.degrees(motion["angle"])
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))
    (position,) = (s for s in answer.reading.signals if s.key == "shaft.position")
    assert position.unit == unit
    assert "by the forces, which are 1 times the model's" in position.assumed[0]


WINCH = """<mujoco><compiler angle="radian"/><worldbody>
<body name="drum"><joint name="drum" axis="0 1 0" damping="0.5"/>
<inertial pos="0 0 0" mass="9" diaginertia="0.1 0.1 0.1"/></body>
<body name="load"><joint name="load" type="slide" axis="0 0 1" damping="4"/>
<inertial pos="0 0 0" mass="40" diaginertia="0.6 0.6 0.6"/></body></worldbody>
<tendon><fixed name="rope" stiffness="60000" damping="180" springlength="0">
<joint joint="drum" coef="0.06"/><joint joint="load" coef="-1"/></fixed></tendon>
<actuator><motor name="motor" joint="drum" gear="30"/></actuator></mujoco>"""


def test_a_slide_beside_a_drum_is_never_in_degrees(tmp_path: Path):
    (tmp_path / "winch.xml").write_text(WINCH)
    time = PERIOD * np.arange(ROWS)
    lift = 0.8 + 0.4 * np.sin(0.9 * time) + 0.2 * np.sin(2.3 * time)
    speed, rate = np.gradient(lift, PERIOD), np.gradient(np.gradient(lift, PERIOD), PERIOD)
    tension = 40.0 * (9.81 + rate) + 4.0 * speed
    drum = (lift + tension / 60000.0) / 0.06
    torque = 0.1 * rate / 0.06 + 0.5 * speed / 0.06 + 0.06 * tension
    log = {"t": time, "tau_motor": torque / 30.0, "phi_drum": drum, "z_load": lift}
    answer = rigtwin.describe(tmp_path / "winch.xml", write_log(tmp_path / "log.csv", log))
    units = {signal.key: signal.unit for signal in answer.reading.signals}
    assert units["drum.position"] == "rad"
    assert units["load.position"] == "m"


@pytest.mark.parametrize(("largest", "is_taken"), [(2.0, True), (0.02, False), (40.0, False)])
def test_a_current_that_the_model_explains_badly_may_still_be_the_control(
    tmp_path: Path, largest: float, is_taken: bool
):
    model = tmp_path / "shaft.xml"
    limits = 'gear="11" ctrllimited="true" ctrlrange="-3 3"'
    model.write_text(SHAFT.replace('gear="{gear}"', limits))
    # A wave along the stroke takes nearly all of the current.
    motion = shaft_motion()
    current = largest * np.sin(40.0 * motion["angle"])
    log = {"time": motion["time"], "shaft_position": motion["angle"], "motor_current": current}
    path, units = write_log(tmp_path / "log.csv", log), {"*.position": "[rad]"}
    if not is_taken:
        with pytest.raises(RigtwinError, match="what force at the joint does one ampere make"):
            rigtwin.describe(model, path, columns=units)
        return
    answer = rigtwin.describe(model, path, columns=units)
    (force,) = (signal for signal in answer.reading.signals if signal.key == "shaft.force")
    assert force.scale == 11.0
    assert "its control may be -3 to 3, which the current makes use of" in force.assumed[0]


@pytest.mark.parametrize(("share", "is_doubted"), [(6.0, False), (60.0, True), (0.05, True)])
def test_a_stated_unit_is_doubted_only_by_a_very_different_force(
    tmp_path: Path, share: float, is_doubted: bool
):
    motion = shaft_motion()
    table = np.stack([motion["time"], motion["angle"], share * motion["torque"]], axis=1)
    log = tmp_path / "log.csv"
    names = "time [s],angle [rad],torque [Nm]"
    np.savetxt(log, table, delimiter=",", header=names, comments="")
    model = write_shaft(tmp_path)
    if is_doubted:
        with pytest.raises(RigtwinError, match="is it in another unit"):
            rigtwin.describe(model, log)
    else:
        (torque,) = (
            signal
            for signal in rigtwin.describe(model, log).reading.signals
            if signal.key == "shaft.force"
        )
        assert torque.checked == "not confirmed by inverse dynamics (6 times the model's)"


def test_a_torque_in_percent_is_a_question(tmp_path: Path):
    motion = shaft_motion()
    log, model = tmp_path / "log.csv", write_shaft(tmp_path)
    table = np.stack([motion["time"], motion["angle"], 100.0 * motion["torque"]], axis=1)
    np.savetxt(log, table, delimiter=",", header="time,angle,torque [%]", comments="")
    with pytest.raises(RigtwinError, match="how much is one percent"):
        rigtwin.describe(model, log)
    answer = rigtwin.describe(model, log, columns={"shaft.force": "0.01 * torque"})
    assert [signal.key for signal in answer.reading.signals] == ["shaft.position", "shaft.force"]


def test_forces_that_fit_no_unit_leave_the_question(tmp_path: Path):
    motion = shaft_motion(3.0)
    # Between both units: a torque in Ncm, or behind an unknown gear.
    motion["torque"] = motion["torque"] / 8.0
    with pytest.raises(RigtwinError, match="are these rad or degrees"):
        rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))


@pytest.mark.parametrize(
    ("name", "factor", "unit"), [("ms", 1e3, "ms"), ("timespan", 1.0, "s"), ("x0", 1.0, "s")]
)
def test_a_column_that_rises_evenly_is_the_time(
    tmp_path: Path, name: str, factor: float, unit: str
):
    motion = shaft_motion()
    motion = {name: factor * motion.pop("time"), **motion}
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))
    assert (answer.reading.clock.column, answer.reading.clock.unit) == (name, unit)


@pytest.mark.parametrize("step", [1.0, 10.0])
@pytest.mark.parametrize("name", ["x0", "position_2"])
def test_a_number_of_the_row_is_no_time(tmp_path: Path, name: str, step: float):
    motion = shaft_motion()
    motion = {name: step * np.arange(float(ROWS)), **motion}
    del motion["time"]
    with pytest.raises(RigtwinError, match="no column is named as the time"):
        rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))


def test_a_time_by_name_comes_before_a_unit_of_time(tmp_path: Path):
    motion = shaft_motion()
    motion = {"ms": 1e3 * motion["time"], **motion}
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))
    assert answer.reading.clock.column == "time"


def test_the_command_of_a_servo_is_no_force(tmp_path: Path):
    path = tmp_path / "servo.xml"
    motor = '<motor name="motor" joint="shaft" gear="1.0"/>'
    servo = '<position name="motor" joint="shaft" kp="20" kv="1"/>'
    path.write_text(SHAFT.format(gear=1.0).replace(motor, servo))
    motion = shaft_motion(3.0)
    columns = {"time": motion["time"], "angle": motion["angle"], "target": motion["angle"]}
    with pytest.raises(RigtwinError, match="are these rad or degrees"):
        rigtwin.describe(path, write_log(tmp_path / "log.csv", columns))


def test_of_one_signal_in_two_units_the_one_with_a_unit_counts(tmp_path: Path):
    motion = shaft_motion()
    motion["angle_deg"] = np.degrees(motion["angle"])
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))
    (position,) = (s for s in answer.reading.signals if s.key == "shaft.position")
    assert (position.column, position.unit) == ("angle_deg", "deg")


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_an_angle_that_jumps_by_a_turn_is_unwrapped(tmp_path: Path, unit: str):
    motion = shaft_motion(3.0)
    true = motion["angle"]
    turns = (true + np.pi) % (2.0 * np.pi) - np.pi
    columns = {"time": motion["time"], f"angle_{unit}": turns, "torque": motion["torque"]}
    if unit == "deg":
        columns["angle_deg"] = np.degrees(turns)
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", columns))
    assert any("so it is unwrapped" in note for note in answer.assumptions)
    stated = {"shaft.position": f"angle_{unit} [{unit}]"}
    log = tmp_path / "log.csv"
    for read in (answer, rigtwin.describe(write_shaft(tmp_path), log, columns=stated)):
        recorded = read.record().column("/sensor", "shaft_position")
        assert recorded == pytest.approx(true, abs=1e-6)


def test_a_position_without_a_number_is_refused(tmp_path: Path):
    motion = shaft_motion()
    motion["angle"] = np.full(ROWS, np.nan)
    with pytest.raises(RigtwinError, match="column 'angle', the position of joint shaft, holds no"):
        rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))


def test_a_motor_may_push_backwards(tmp_path: Path):
    motion = shaft_motion()
    command = -motion.pop("torque") / 0.5
    motion |= {"motor_command": command}
    answer = rigtwin.describe(write_shaft(tmp_path, -0.5), write_log(tmp_path / "log.csv", motion))
    (signal,) = (s for s in answer.reading.signals if s.key == "shaft.command")
    assert signal.sign == 1.0
    assert "confirmed by inverse dynamics (1 times" in signal.checked
    assert component_of(answer.machine.plant, "motor", ForceActuator).constant == -0.5


def test_a_closed_loop_is_refused(tmp_path: Path):
    path = tmp_path / "loop.xml"
    path.write_text(LOOP)
    log = write_log(tmp_path / "log.csv", shaft_motion())
    with pytest.raises(RigtwinError, match="connect equality of bodies crank and rocker closes"):
        rigtwin.describe(path, log)


@pytest.mark.parametrize(
    ("unit", "rate"), [("rad", "rpm"), ("deg", "rpm"), ("deg", "rad/s"), ("rad", "deg/s")]
)
def test_a_velocity_tells_rad_from_degrees(tmp_path: Path, unit: str, rate: str):
    motion = shaft_motion(30.0)
    per_radian = {"rad": 1.0, "deg": 180.0 / np.pi, "rpm": 30.0 / np.pi}
    speed = np.gradient(motion["angle"], motion["time"])
    motion["speed"] = per_radian[rate.removesuffix("/s")] * speed
    motion["angle"] = per_radian[unit] * motion["angle"]
    answer = rigtwin.describe(write_shaft(tmp_path), write_log(tmp_path / "log.csv", motion))
    (position,) = (s for s in answer.reading.signals if s.key == "shaft.position")
    assert position.unit == unit
    assert position.assumed[0] == f"{unit} by 'speed', which is its rate in {rate}"


def test_a_torque_before_the_models_gear_is_scaled_and_tells_the_unit(tmp_path: Path):
    gear, gravity = 30.0, 2.0
    path = tmp_path / "arm.xml"
    path.write_text(
        SHAFT.format(gear=gear)
        .replace('gravity="0 0 0"', 'gravity="0 0 -9.81"')
        .replace('axis="0 0 1"', 'axis="0 1 0"')
        .replace('pos="0 0 0" mass="1"', f'pos="0 0 {-gravity / 9.81}" mass="1"')
    )
    motion = shaft_motion(3.0)
    inertia = INERTIA + (gravity / 9.81) ** 2
    motion["torque"] *= inertia / INERTIA
    motion["torque"] += gravity * np.sin(motion["angle"])
    motion["motor_torque"] = motion.pop("torque") / gear
    answer = rigtwin.describe(path, write_log(tmp_path / "log.csv", motion))
    assumed = "; ".join(answer.assumptions)
    assert "rad by the forces, of which the model explains" in assumed
    assert "before the gear of the model's actuator: times 30" in assumed
    force = answer.record()["/sensor.shaft_force"]
    assert force == pytest.approx(gear * motion["motor_torque"])
