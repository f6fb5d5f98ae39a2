"""Setpoints of positions beside actuators that take forces, and units that overrule names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigtwin.describing.heading import read_words, split_words
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.reading import read_log
from rigtwin.description.mechanism import Mechanism
from rigtwin.importing.columns import Columns

AXIS = """
<mujoco>
  <worldbody>
    <body name="carriage">
      <joint name="x" type="slide" axis="1 0 0" damping="6"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
  <actuator><motor name="servo" joint="x" gear="11.3"/></actuator>
</mujoco>
"""
PERIOD, ROWS = 0.002, 2000


def _columns(tmp_path: Path, headings: dict[str, str]) -> tuple[Mechanism, Columns]:
    """A carriage that a motor moves; heading → what it holds."""
    (tmp_path / "axis.xml").write_text(AXIS)
    time = PERIOD * np.arange(ROWS)
    angle = 2.0 * np.pi * 1.3 * time
    position, rate = 0.1 * np.sin(angle), 2.0 * np.pi * 1.3
    velocity, acceleration = 0.1 * rate * np.cos(angle), -0.1 * rate**2 * np.sin(angle)
    quantities = {
        "time": time,
        "position": position,
        "setpoint": position + 2e-4 * np.cos(angle),
        "current": (2.0 * acceleration + 6.0 * velocity) / 11.3,
    }
    values = {heading: quantities[quantity] for heading, quantity in headings.items()}
    return Mechanism(tmp_path / "axis.xml"), Columns(values)


@pytest.mark.parametrize("setpoint", ["x_set_mm", "x_ref", "target_x"])
def test_a_setpoint_is_no_force(tmp_path: Path, setpoint: str) -> None:
    """The current beside a position's setpoint is what moves the carriage."""
    headings = {"t": "time", "x_act": "position", setpoint: "setpoint", "i_q": "current"}
    reading = read_log(*_columns(tmp_path, headings), {})
    (force,) = [each for each in reading.signals if each.quantity is JointQuantity.FORCE]
    assert force.column == "i_q"
    assert "setpoint" in reading.unused[setpoint]


def test_a_command_in_the_unit_of_the_control_stays(tmp_path: Path) -> None:
    """A current that is called a command is one, whatever the position does."""
    headings = {"t": "time", "x_act": "position", "cmd_x": "current"}
    reading = read_log(*_columns(tmp_path, headings), {})
    assert [each.column for each in reading.signals] == ["x_act", "cmd_x"]


@pytest.mark.parametrize("heading", ["i_cmd_mA", "Vm_cmd"])
def test_a_commanded_current_or_voltage_is_the_control(tmp_path: Path, heading: str) -> None:
    """A current in mA drives a motor whose gear is its torque constant per ampere."""
    headings = {"t": "time", "x_act": "position", heading: "current"}
    # A current that was measured as well would be what moves the joint, but no voltage.
    headings |= {"Im_meas": "current"} if heading == "Vm_cmd" else {}
    mechanism, columns = _columns(tmp_path, headings)
    scale = 1e-3 if heading.endswith("mA") else 1.0
    values = {name: np.array(column) for name, column in columns.values.items()}
    values[heading] /= scale
    reading = read_log(mechanism, Columns(values), {})
    (command,) = [each for each in reading.signals if each.quantity is not JointQuantity.POSITION]
    assert (command.column, command.scale) == (heading, scale)


@pytest.mark.parametrize(
    ("name", "unit", "quantity"),
    [
        ("i_q", "", JointQuantity.CURRENT),
        ("iq1", "", JointQuantity.CURRENT),
        ("q", "A", JointQuantity.CURRENT),
        ("phi", "rad/s", JointQuantity.VELOCITY),
        ("velocity", "deg", JointQuantity.VELOCITY),
        ("position_error", "mm", JointQuantity.OTHER),
        ("q", "", JointQuantity.POSITION),
    ],
)
def test_units_overrule_names(name: str, unit: str, quantity: JointQuantity) -> None:
    """A unit states the quantity of a word that could be several."""
    assert read_words(split_words(name), unit).quantity is quantity
