"""Columns that together may be the force at a joint: the pressures in a cylinder."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

RAM = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
<body name="table"><joint name="ram" type="slide" axis="0 0 1" damping="400"/>
<inertial pos="0 0 0" mass="180" diaginertia="6 6 8"/></body></worldbody><actuator>
<general name="chamber_A" joint="ram" gear="0.002" gainprm="1"/>
<general name="chamber_B" joint="ram" gear="-0.0012" gainprm="1"/></actuator></mujoco>"""
PERIOD, ROWS = 5e-3, 2000


def lifted(coulomb: float) -> dict[str, Array]:
    """Return the pressures in bar that lift the table against dry friction, N."""
    time = PERIOD * np.arange(ROWS)
    position = 0.1 * np.sin(1.3 * time) + 0.03 * np.sin(5.1 * time)
    speed = np.gradient(position, PERIOD)
    force = 180.0 * (np.gradient(speed, PERIOD) + 9.81) + 400.0 * speed + coulomb * np.sign(speed)
    rod = 1.5e6 + 2e5 * np.sin(0.7 * time)
    random = np.random.default_rng(5)
    bore = (force + 0.0012 * rod + 2.0 * random.standard_normal(ROWS)) / 0.002
    return {"time": time, "ram_mm": 1e3 * position, "p2_bar": 1e-5 * rod, "p1_bar": 1e-5 * bore}


def test_the_pressures_of_a_cylinder_are_suggested_with_areas_and_unit(tmp_path: Path) -> None:
    model = tmp_path / "ram.xml"
    model.write_text(RAM)
    log = write_log(tmp_path / "log.csv", lifted(150.0))
    with pytest.raises(rigtwin.RigtwinError, match="controls of chamber_A, chamber_B") as asked:
        rigtwin.diagnose(log, machine=model)
    # Which column belongs to which chamber follows from the model.
    said = re.search(r'"ram\.force=(.*)"', str(asked.value))
    assert said is not None
    assert said.group(1) == "200 * p1_bar - 120 * p2_bar"
    answer = rigtwin.diagnose(log, machine=model, columns={"ram.force": said.group(1)})
    assert [str(effect.name) for effect in answer.effects] == ["coulomb@ram"]
    assert answer.effects[0].parameters["coulomb"].value == pytest.approx(150.0, rel=0.05)


def test_columns_that_explain_nothing_are_not_suggested(tmp_path: Path) -> None:
    model = tmp_path / "ram.xml"
    model.write_text(RAM)
    columns = lifted(0.0)
    random = np.random.default_rng(6)
    columns["p1_bar"] = random.standard_normal(ROWS)
    columns["p2_bar"] = random.standard_normal(ROWS)
    with pytest.raises(rigtwin.RigtwinError, match="no column is a measured force"):
        rigtwin.diagnose(write_log(tmp_path / "log.csv", columns), machine=model)
