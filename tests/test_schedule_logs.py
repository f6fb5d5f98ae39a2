"""Columns of a log that friction may follow, such as a temperature or a damper's voltage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.diagnosis.report import meaning_of
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

PISTON = """<mujoco><worldbody>
<body name="rod"><joint name="piston" type="slide" axis="1 0 0"/>
<geom type="sphere" size="0.1" mass="2"/></body>
{more}</worldbody>{actuators}</mujoco>"""
SECOND = """<body name="arm"><joint name="valve" type="slide" axis="0 1 0"/>
<geom type="sphere" size="0.1" mass="2"/></body>"""
MOTOR = '<actuator><motor name="motor" joint="piston"/></actuator>'
PERIOD, ROWS, MASS = 4e-3, 3000, 2.0


def write_piston(folder: Path, more: str = "", actuators: str = "") -> Path:
    path = folder / "piston.xml"
    path.write_text(PISTON.format(more=more, actuators=actuators))
    return path


def moved(warm: float) -> dict[str, Array]:
    """Motion of a piston whose viscous friction is 60 Ns/m at 20 degrees, less `warm` a degree."""
    time = PERIOD * np.arange(ROWS)
    position, speed, acceleration = np.zeros((3, ROWS))
    for size, rate in ((0.08, 3.1), (0.03, 9.7)):
        position += size * np.sin(rate * time)
        speed += size * rate * np.cos(rate * time)
        acceleration -= size * rate**2 * np.sin(rate * time)
    temperature = 20.0 + 15.0 * (1.0 - np.exp(-time / 4.0))
    force = MASS * acceleration + (60.0 - warm * (temperature - 20.0)) * speed
    random = np.random.default_rng(3)
    return {
        "time": time,
        "position": position + 2e-6 * random.standard_normal(ROWS),
        "force": force + 0.02 * random.standard_normal(ROWS),
        "temperature": temperature,
    }


@pytest.mark.slow
def test_friction_that_follows_a_temperature_is_named_with_its_slope(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", moved(1.5))
    answer = rigtwin.diagnose(log, machine=write_piston(tmp_path))
    effects = {str(finding.name): finding for finding in answer.effects}
    assert set(effects) == {"viscous@piston", "viscous@temperature"}
    slope = effects["viscous@temperature"].parameters["viscous"]
    assert slope.value == pytest.approx(-1.5, rel=0.03)
    # No column says the unit of the temperature.
    assert slope.unit == "Ns/m/unit"
    meaning = meaning_of(effects["viscous@temperature"])
    assert meaning == "viscous friction that falls as the recorded channel grows"
    assert meaning_of(effects["viscous@piston"]) == "friction in proportion to the speed"
    # Per degree from zero degrees on.
    at_zero = effects["viscous@piston"].parameters["viscous"]
    assert at_zero.value == pytest.approx(60.0 + 1.5 * 20.0, rel=0.03)


@pytest.mark.slow
def test_friction_that_fades_exponentially_with_a_temperature_is_named(tmp_path: Path) -> None:
    """Friction 60·exp(−(T − 20)/12) Ns/m, that of an oil."""
    model, logs = write_piston(tmp_path), []
    for name, fastest in (("fit.csv", 1.0), ("held.csv", 1.3)):
        columns = moved(0.0)
        speed, warm = np.gradient(columns["position"], PERIOD), columns["temperature"] - 20.0
        columns["temperature"] = 20.0 + fastest * warm
        fading = 60.0 * (np.exp(-fastest * warm / 12.0) - 1.0)
        logs.append(
            write_log(tmp_path / name, {**columns, "force": columns["force"] + fading * speed})
        )
    answer = rigtwin.diagnose(logs[0], machine=model, held_out=logs[1])
    effects = {str(finding.name): finding.parameters for finding in answer.effects}
    assert set(effects) == {"viscous@piston", "viscous@temperature", "growth@temperature"}
    assert effects["growth@temperature"]["growth"].value == pytest.approx(-1.0 / 12.0, rel=0.05)
    assert answer.verdict == "explained"


@pytest.mark.parametrize(
    ("column", "actuators", "joint"),
    [
        ("oil_temperature", "", "piston"),
        ("oil_temperature", MOTOR, "piston"),
        ("coil voltage", "", "piston"),
        # The voltage of the motor that moves the joint.
        ("voltage", MOTOR, None),
        ("status", "", None),
    ],
)
def test_a_column_may_be_followed_by_its_name(
    tmp_path: Path, column: str, actuators: str, joint: str | None
) -> None:
    columns = moved(0.0)
    columns[column] = columns.pop("temperature")
    model = write_piston(tmp_path, actuators=actuators)
    answer = rigtwin.describe(model, write_log(tmp_path / "log.csv", columns))
    followed = [(each.column, each.joint) for each in answer.reading.schedules]
    assert followed == ([(column, joint)] if joint else [])
    assert ('type = "schedule"' in answer.description) == bool(joint)


def test_a_column_that_hardly_varies_is_not_followed(tmp_path: Path) -> None:
    columns = moved(0.0)
    columns["temperature"] = 20.0 + 0.01 * columns["temperature"]
    answer = rigtwin.describe(write_piston(tmp_path), write_log(tmp_path / "log.csv", columns))
    assert answer.reading.schedules == ()
    assert "temperature" in answer.reading.unused


def test_of_two_joints_the_one_that_is_named_follows(tmp_path: Path) -> None:
    columns = moved(0.0)
    temperature = columns.pop("temperature")
    columns = {
        "time": columns["time"],
        "piston_pos": columns["position"],
        "valve_pos": 0.5 * columns["position"],
        "piston_force": columns["force"],
        "valve_force": 0.5 * columns["force"],
        "valve_temp": temperature,
        "room_temp": temperature[::-1].copy(),
    }
    answer = rigtwin.describe(
        write_piston(tmp_path, SECOND), write_log(tmp_path / "log.csv", columns)
    )
    assert [(each.column, each.joint) for each in answer.reading.schedules] == [
        ("valve_temp", "valve"),
        ("room_temp", ""),
    ]
    assert '"/sensor.room_temp"' in answer.mapping
    assert "room_temp" not in answer.description


def test_columns_of_alike_names_have_names_of_their_own(tmp_path: Path) -> None:
    columns = moved(0.0)
    temperature = columns.pop("temperature")
    columns |= {"temp 1": temperature, "temp-1": temperature[::-1].copy()}
    answer = rigtwin.describe(write_piston(tmp_path), write_log(tmp_path / "log.csv", columns))
    names = [schedule.name for schedule in answer.reading.schedules]
    assert names == ["temp_1", "temp_1_column"]
